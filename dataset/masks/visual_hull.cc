#include "dataset/masks/visual_hull.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/check.h"

namespace mvstudio::dataset {
namespace {

using geometry::Projector;
using geometry::RigCamera;

/// One silhouette, prepared for queries.
struct Silhouette {
  const RigCamera* camera;
  Projector projector;
  cv::Mat distance;  // CV_32F, px to the nearest mask pixel, 0 on the mask
  bool carves = true;

  explicit Silhouette(const HullView& view) : camera(view.camera), projector(view.camera->camera) {
    const Image& m = *view.mask;
    const cv::Mat mask(m.height, m.width, CV_8U, const_cast<uint8_t*>(m.pixels.data()));
    carves = cv::countNonZero(mask) > 0;
    if (carves) cv::distanceTransform(mask == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  }

  /// Pixel and an upper bound of the length in pixels of a small step of one metre at x.
  bool Project(const Eigen::Vector3d& x_in_world, Eigen::Vector2d* px, double* px_per_m) const {
    constexpr double kDistortion = 1.1;  // the lens may stretch more than a pinhole
    const Eigen::Vector3d x = camera->cam_from_world * x_in_world;
    const geometry::Projection p = projector.Project(x);
    if (p.status != Status::kOk) return false;
    *px = p.px;
    const double f = 0.5 * (camera->camera.fx() + camera->camera.fy()), range = x.norm();
    *px_per_m = kDistortion * f * (x.z() > 0.3 * range ? range / (x.z() * x.z()) : 4 / range);
    return true;
  }

  enum class Answer { kUnseen, kForbidden, kMixed };
  /// `finest`: the cell is judged by its centre.
  Answer Ask(const Eigen::Vector3d& centre, double half_m, bool finest) const {
    Eigen::Vector2d px;
    double px_per_m = 0;
    if (!carves || !Project(centre, &px, &px_per_m)) return Answer::kUnseen;
    const double radius = finest ? 0.75 : std::sqrt(3.0) * half_m * px_per_m + 1;
    if (px.x() < -0.5 || px.y() < -0.5 || px.x() >= distance.cols - 0.5 || px.y() >= distance.rows - 0.5) {
      return Answer::kUnseen;
    }
    return distance.at<float>(int(px.y() + 0.5), int(px.x() + 0.5)) > radius ? Answer::kForbidden : Answer::kMixed;
  }
};

/// How many cameras forbid a cell; stops at two.
int Forbidding(const std::vector<Silhouette>& silhouettes, const Eigen::Vector3d& centre, double half_m, bool finest,
               int* who) {
  int count = 0, seen = 0;
  for (size_t c = 0; c < silhouettes.size() && count < 2; ++c) {
    const Silhouette::Answer answer = silhouettes[c].Ask(centre, half_m, finest);
    seen += answer != Silhouette::Answer::kUnseen;
    if (answer == Silhouette::Answer::kForbidden) ++count, *who = static_cast<int>(c);
  }
  return finest && seen < 2 ? 2 : count;  // what one camera alone sees is no evidence
}

/// The cells of the next level; nothing when there would be too many.
std::optional<std::vector<HullCell>> Refine(const std::vector<Silhouette>& silhouettes, const std::vector<HullCell>& cells,
                                            bool finest, size_t most) {
  std::vector<HullCell> finer;
  for (const HullCell& cell : cells) {
    const float half = 0.5f * cell.half_m;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3f side(corner & 1 ? half : -half, corner & 2 ? half : -half, corner & 4 ? half : -half);
      HullCell child{cell.centre + side, half, -1};
      int who = -1;
      const int count = Forbidding(silhouettes, child.centre.cast<double>(), half, finest, &who);
      if (count > 1) continue;
      child.forbidden_by = static_cast<int16_t>(count ? who : -1);
      finer.push_back(child);
      if (finer.size() > most) return std::nullopt;
    }
  }
  return finer;
}

/// Marks what the cells that `select` names show in a camera.
template <class Select>
cv::Mat Shown(const VisualHull& hull, const Silhouette& view, const Select& select) {
  cv::Mat shown = cv::Mat::zeros(view.camera->camera.height_px, view.camera->camera.width_px, CV_8U);
  for (const HullCell& cell : hull.cells) {
    if (!select(cell)) continue;
    Eigen::Vector2d px;
    double px_per_m = 0;
    if (!view.Project(cell.centre.cast<double>(), &px, &px_per_m)) continue;
    const double half = std::clamp(cell.half_m * px_per_m, 0.5, 1e4);
    if (px.cwiseAbs().maxCoeff() > 1e6) continue;
    const cv::Point a(int(std::ceil(px.x() - half)), int(std::ceil(px.y() - half)));
    const cv::Point b(int(std::floor(px.x() + half)), int(std::floor(px.y() + half)));
    const cv::Rect square = cv::Rect(a, b + cv::Point(1, 1)) & cv::Rect(0, 0, shown.cols, shown.rows);
    if (!square.empty()) shown(square).setTo(255);
  }
  return shown;
}

/// Share of `of` that lies farther than `tolerance_px` from `from`.
double ShareBeyond(const cv::Mat& of, const cv::Mat& from, double tolerance_px) {
  const int total = cv::countNonZero(of);
  if (total == 0) return 0;
  if (cv::countNonZero(from) == 0) return 1;
  cv::Mat distance;
  cv::distanceTransform(from == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return cv::countNonZero((distance > tolerance_px) & of) / double(total);
}

cv::Mat MaskOf(const HullView& view) {
  return cv::Mat(view.mask->height, view.mask->width, CV_8U, const_cast<uint8_t*>(view.mask->pixels.data()));
}

void Compare(const std::vector<HullView>& views, const std::vector<Silhouette>& silhouettes, const HullOptions& options,
             VisualHull* hull) {
  const size_t n = views.size();
  std::vector<double> outside(n);
  for (size_t c = 0; c < n; ++c) {
    const cv::Mat mask = MaskOf(views[c]);
    const auto everybody = [](const HullCell& cell) { return cell.forbidden_by < 0; };
    const auto others = [c](const HullCell& cell) { return cell.forbidden_by < 0 || cell.forbidden_by == int(c); };
    HullAgreement& a = hull->cameras[c];
    a.mask_px = cv::countNonZero(mask);
    a.outside = ShareBeyond(mask, Shown(*hull, silhouettes[c], everybody), options.tolerance_px);
    a.missing = ShareBeyond(Shown(*hull, silhouettes[c], others), mask, options.tolerance_px);
  }
  for (size_t c = 0; c < n; ++c) {
    const bool carved =
        std::any_of(hull->cells.begin(), hull->cells.end(), [c](const HullCell& x) { return x.forbidden_by == int(c); });
    if (!carved || n < 3) continue;
    for (size_t d = 0; d < n; ++d) {
      if (d == c || hull->cameras[d].outside == 0) continue;
      const auto without = [c](const HullCell& cell) { return cell.forbidden_by < 0 || cell.forbidden_by == int(c); };
      const double left = ShareBeyond(MaskOf(views[d]), Shown(*hull, silhouettes[d], without), options.tolerance_px);
      hull->cameras[c].blame += (hull->cameras[d].outside - left) / double(n - 1);
    }
  }
}

}  // namespace

HullBox BoxOfJoints(const std::map<int, Coco19Pose>& people, double margin_m) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
  bool any = false;
  for (const auto& [id, pose] : people) {
    for (int j = 0; j < 19; ++j) {
      if (!pose.valid[j] || !pose.x_in_world.col(j).allFinite()) continue;
      low = low.cwiseMin(pose.x_in_world.col(j)), high = high.cwiseMax(pose.x_in_world.col(j));
      any = true;
    }
  }
  if (!any) return {Status::kTooFewViews, {}, 0};
  return {Status::kOk, 0.5 * (low + high), 0.5 * (high - low).maxCoeff() + margin_m};
}

HullBox BoxOfMasks(const std::vector<HullView>& views) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::vector<std::pair<const RigCamera*, double>> sizes;  // mask's longer side, px
  for (const HullView& view : views) {
    const cv::Rect box = cv::boundingRect(MaskOf(view));
    if (box.empty()) continue;
    const Eigen::Vector2d middle(box.x + 0.5 * (box.width - 1), box.y + 0.5 * (box.height - 1));
    const geometry::Unprojection ray = geometry::Unproject(view.camera->camera, middle);
    if (ray.status != Status::kOk) continue;
    const Eigen::Vector3d along = view.camera->cam_from_world.rotation.conjugate() * ray.ray_in_cam.normalized();
    const Eigen::Matrix3d plane = Eigen::Matrix3d::Identity() - along * along.transpose();
    across += plane, sum += plane * view.camera->CenterInWorld();
    sizes.push_back({view.camera, std::max(box.width, box.height)});
  }
  if (sizes.size() < 2) return {Status::kTooFewViews, {}, 0};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(across);
  if (!(solver.eigenvalues()[0] > 1e-4)) return {Status::kLowParallax, {}, 0};
  HullBox box{Status::kOk, across.ldlt().solve(sum), 0};
  for (const auto& [camera, size_px] : sizes) {
    const Eigen::Vector3d x = camera->cam_from_world * box.centre;
    if (x.z() <= 0) return {Status::kBehindCamera, {}, 0};
    const double f = std::min(camera->camera.fx(), camera->camera.fy());
    box.half_m = std::max(box.half_m, 0.75 * size_px * x.norm() / f);
  }
  return box;
}

VisualHull CarveHull(const std::vector<HullView>& views, const HullBox& box, const HullOptions& options) {
  VisualHull hull;
  hull.cameras.resize(views.size());
  std::vector<Silhouette> silhouettes;
  int carving = 0;
  for (const HullView& view : views) {
    MVS_CHECK(view.mask->width == view.camera->camera.width_px && view.mask->height == view.camera->camera.height_px,
              "a mask of " << view.mask->width << "x" << view.mask->height << " and a camera of "
                           << view.camera->camera.width_px << "x" << view.camera->camera.height_px);
    silhouettes.emplace_back(view);
    carving += silhouettes.back().carves;
  }
  hull.status = carving < 2 ? Status::kTooFewViews : box.status;
  if (hull.status == Status::kOk && !(box.centre.allFinite() && box.half_m > 0 && std::isfinite(box.half_m)))
    hull.status = Status::kNonFiniteInput;
  if (hull.status != Status::kOk) return hull;

  hull.cells = {{box.centre.cast<float>(), static_cast<float>(box.half_m), -1}};
  for (double half = box.half_m; 2 * half > options.voxel_m; half *= 0.5) {
    const bool finest = half <= options.voxel_m;
    auto finer = Refine(silhouettes, hull.cells, finest, static_cast<size_t>(options.most_cells));
    if (!finer) break;
    hull.cells = std::move(*finer);
  }
  if (!hull.cells.empty()) hull.voxel_m = 2 * hull.cells[0].half_m;
  for (const HullCell& cell : hull.cells) hull.volume_m3 += cell.forbidden_by < 0 ? std::pow(2 * cell.half_m, 3) : 0;
  if (hull.volume_m3 == 0) hull.status = Status::kDegenerate;
  Compare(views, silhouettes, options, &hull);
  return hull;
}

Image PossiblePixels(const VisualHull& hull, const RigCamera& camera, double margin_px) {
  const Image nothing(camera.camera.width_px, camera.camera.height_px, 1, 0);
  const Silhouette view({&camera, &nothing});
  cv::Mat shown = Shown(hull, view, [](const HullCell&) { return true; });
  Image possible(shown.cols, shown.rows, 1, 0);
  if (cv::countNonZero(shown) == 0) return possible;
  cv::Mat distance;
  cv::distanceTransform(shown == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::Mat(shown.rows, shown.cols, CV_8U, possible.pixels.data()).setTo(255, distance <= margin_px);
  return possible;
}

void HullSummary::Add(const VisualHull& hull) {
  if (hull.status != Status::kOk && hull.status != Status::kDegenerate) {
    ++skipped;
    return;
  }
  sums.resize(std::max(sums.size(), hull.cameras.size()));
  for (size_t c = 0; c < hull.cameras.size(); ++c) {
    sums[c].mask_px += hull.cameras[c].mask_px;
    sums[c].outside += hull.cameras[c].outside;
    sums[c].missing += hull.cameras[c].missing;
    sums[c].blame += hull.cameras[c].blame;
  }
  ++time_steps;
}

HullAgreement HullSummary::Mean(size_t camera) const {
  if (time_steps == 0 || camera >= sums.size()) return {};
  const HullAgreement& s = sums[camera];
  const double n = time_steps;
  return {s.mask_px / n, s.outside / n, s.missing / n, s.blame / n};
}

std::vector<size_t> HullSummary::Disagreeing(double most_outside) const {
  std::vector<size_t> list;
  double most_blame = 0;
  for (size_t c = 0; c < sums.size(); ++c) most_blame = std::max(most_blame, Mean(c).blame);
  for (size_t c = 0; c < sums.size(); ++c) {
    const HullAgreement a = Mean(c);
    // When somebody's small mask explains what the others show too much, the others are not at fault.
    const bool explained = most_blame > 0.5 * most_outside && a.blame < 0.5 * most_blame;
    if ((a.outside > most_outside && !explained) || (a.blame > 0.5 * most_outside && a.blame >= 0.5 * most_blame))
      list.push_back(c);
    else if (a.mask_px == 0 && a.missing > 0.5)
      list.push_back(c);
  }
  return list;
}

double HullSummary::Disagreement() const {
  double sum = 0;
  for (size_t c = 0; c < sums.size(); ++c) sum += Mean(c).outside + Mean(c).missing;
  return sums.empty() ? 0 : sum / double(sums.size());
}

}  // namespace mvstudio::dataset
