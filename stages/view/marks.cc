#include "stages/view/marks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mvstudio::stages {
namespace {

constexpr double kOutlineTolerancePx = 1;
constexpr int kPartsOfEdge = 12;  // a straight line is none behind a lens

Eigen::Vector2d SeenPx(const geometry::RigCamera& camera, const geometry::Projector& lens, const Eigen::Vector3d& x_in_world) {
  const auto seen = lens.Project(camera.cam_from_world * x_in_world);
  return seen.status == Status::kOk ? seen.px : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

OutlinePx LinePx(const geometry::RigCamera& camera, const geometry::Projector& lens, const Eigen::Vector3d& a,
                 const Eigen::Vector3d& b) {
  OutlinePx line;
  for (int i = 0; i <= kPartsOfEdge; ++i)
    line.push_back(SeenPx(camera, lens, a + static_cast<double>(i) / kPartsOfEdge * (b - a)));
  return line;
}

void AddBoard(const PlacedBoard& board, const geometry::RigCamera& camera, const geometry::Projector& lens, ViewMarks* marks) {
  const Eigen::Index n = board.outline.cols();
  for (Eigen::Index i = 0; i < n; ++i)
    marks->boards.push_back(LinePx(camera, lens, board.outline.col(i), board.outline.col((i + 1) % n)));
  marks->x_axes.push_back(LinePx(camera, lens, board.axes.col(0), board.axes.col(1)));
  marks->y_axes.push_back(LinePx(camera, lens, board.axes.col(0), board.axes.col(2)));
}

std::vector<OutlinePx> BodyOutlines(const SolidsNow& now, const geometry::RigCamera& camera, const geometry::Projector& lens) {
  if (now.vertices.cols() == 0) return {};
  Eigen::Matrix2Xd px(2, now.vertices.cols());
  for (Eigen::Index v = 0; v < px.cols(); ++v) px.col(v) = SeenPx(camera, lens, now.vertices.col(v));
  return OutlinesOf(TriangleMask(px, now.faces, camera.camera.width_px, camera.camera.height_px), kOutlineTolerancePx);
}

/// From a mask of another size to the pixels of the lens; edges go to edges.
void Scale(const Image& mask, const geometry::Camera& lens, std::vector<OutlinePx>* lines) {
  const Eigen::Array2d scale(static_cast<double>(lens.width_px) / mask.width,
                             static_cast<double>(lens.height_px) / mask.height);
  for (OutlinePx& line : *lines)
    for (Eigen::Vector2d& px : line) px = ((px.array() + 0.5) * scale - 0.5).matrix();
}

}  // namespace

bool MarksReader::has_masks() const {
  return std::any_of(scene_.cameras.begin(), scene_.cameras.end(), [](const auto& c) { return !c.mask_folder.empty(); });
}

Image MarksReader::MaskAt(size_t camera_idx, int64_t frame) {
  auto known = masks_.find(camera_idx);
  if (known == masks_.end())
    known = masks_.emplace(camera_idx, MaskFiles(scene_.cameras[camera_idx].mask_folder, scene_.root)).first;
  return known->second.At(frame);
}

ViewMarks MarksReader::At(size_t camera_idx, int step) {
  const SceneCamera& camera = scene_.cameras.at(camera_idx);
  const geometry::RigCamera* placed = camera.rig_idx < 0 ? nullptr : &scene_.rig.cameras[static_cast<size_t>(camera.rig_idx)];
  ViewMarks marks;
  if (const Image mask = MaskAt(camera_idx, FrameAt(scene_, camera_idx, step)); !mask.empty()) {
    marks.mask = OutlinesOf(mask, kOutlineTolerancePx);
    if (placed) Scale(mask, placed->camera, &marks.mask);
  }
  if (!placed) return marks;
  const geometry::Projector lens(placed->camera);
  const SolidsNow now = SolidsAt(solids_, step);
  marks.body = BodyOutlines(now, *placed, lens);
  for (const PlacedBoard& board : now.boards) AddBoard(board, *placed, lens, &marks);
  return marks;
}

}  // namespace mvstudio::stages
