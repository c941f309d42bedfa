#include "calib/corners/corner_files.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/format_text.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/utf8.h"
#include "geometry/rig/foreign_layout.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::calib {
namespace internal {

std::pair<int, int> ParseSize(const std::string& text, const std::string& what) {
  int width = 0, height = 0;
  char end = 0;
  if (std::sscanf(text.c_str(), "%7dx%7d%c", &width, &height, &end) != 2 || width < 1 || height < 1 || width > (1 << 20) ||
      height > (1 << 20)) {
    throw UsageError(what + " '" + text + "': expected WIDTHxHEIGHT in px, e.g. 1920x1080");
  }
  return {width, height};
}

}  // namespace internal

namespace {

/// What is known of a file that is none of ours; begins with "; ", or is empty.
std::string WhatItLooksLike(const std::string& text) {
  const auto has = [&](const char* piece) { return text.find(piece) != std::string::npos; };
  if (has("num_corners:") && has("encoding:"))
    return "; it looks like deltille's .orpc: write its columns as camera,frame,corner,x_px,y_px (docs/corner-files.md)";
  if (const std::string layout = geometry::ForeignLayout(text); !layout.empty()) return "; it looks like " + layout;
  const std::string line = text.substr(0, text.find('\n'));
  if (line.find(',') != std::string::npos && (line.find("corner") != std::string::npos || line.find(",x") != std::string::npos))
    return "; of a table, the header is camera,frame,corner,x_px,y_px (corner: row times columns plus column; "
           "docs/corner-files.md)";
  return "";
}

CornerFormat DetectCornerFormat(const std::string& path) {
  const std::string text = ReadFile(path);
  const auto has = [&](const char* piece) { return text.find(piece) != std::string::npos; };
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) throw FormatError(path, "", "the file is empty");
  if (has("<opencv_storage>") || (text.rfind("%YAML", 0) == 0 && has("mage_points:"))) return CornerFormat::kOpenCv;
  if (has("img_loc_x")) return CornerFormat::kCaliscope;
  if (has("x_px")) return CornerFormat::kCsv;
  if (std::filesystem::path(path).extension() == ".vnl" || has("# filename x y")) return CornerFormat::kVnl;
  throw FormatError(path, "",
                    "not a corner file that is known here; name its format with option 'corners-format' vnl, caliscope, "
                    "opencv or csv" +
                        WhatItLooksLike(text));
}

void ApplySizes(const CornerFileOptions& options, CornerFile* file) {
  for (const CameraSize& size : options.sizes) {
    bool used = false;
    for (CameraInput& camera : file->cameras) {
      if (!size.camera.empty() && camera.name != size.camera) continue;
      used = true;
      const bool known = camera.width_px > 0 && camera.height_px > 0;
      if (known && (camera.width_px != size.width_px || camera.height_px != size.height_px)) {
        throw UsageError("option 'size' " + ToString(size) + ": the corner file says that camera " + camera.name + " has " +
                         std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px) + " px");
      }
      camera.width_px = size.width_px, camera.height_px = size.height_px;
    }
    if (!used) throw UsageError("option 'size' " + ToString(size) + ": the corner file has no camera '" + size.camera + "'");
  }
}

void CheckCorners(const std::string& path, const CornerFile& file) {
  if (file.detections.empty()) throw FormatError(path, "", "no corner in it");
  for (const Detection& detection : file.detections) {
    const Board& board = file.boards[static_cast<size_t>(detection.board_idx)];
    if (detection.corner_ids.back() < board.num_corners()) continue;
    throw FormatError(path, "frame " + std::to_string(detection.frame_idx),
                      "corner " + std::to_string(detection.corner_ids.back()) + " is not on the board, which has " +
                          std::to_string(board.num_corners()) + "; is option 'board' the right one?");
  }
}

/// Is the corner at 0 0, or where another one of its view is? Detectors write so what they did not find.
std::vector<bool> Placeholders(const Detection& detection) {
  std::map<std::pair<double, double>, int> seen;
  for (const auto& px : detection.points_px.colwise()) ++seen[{px.x(), px.y()}];
  std::vector<bool> placeholder;
  for (const auto& px : detection.points_px.colwise()) placeholder.push_back(seen[{px.x(), px.y()}] > 1 || px.isZero(0));
  return placeholder;
}

Detection Without(const Detection& detection, const std::vector<bool>& left_out) {
  Detection rest = detection;
  rest.corner_ids.clear();
  std::vector<int> kept;
  for (size_t i = 0; i < left_out.size(); ++i) {
    if (left_out[i]) continue;
    kept.push_back(static_cast<int>(i));
    rest.corner_ids.push_back(detection.corner_ids[i]);
  }
  rest.points_px = detection.points_px(Eigen::all, kept).eval();
  if (detection.sigmas_px.size() > 0) rest.sigmas_px = detection.sigmas_px(kept).eval();
  return rest;
}

void DropPlaceholders(CornerFile* file) {
  Eigen::Index dropped = 0;
  std::vector<Detection> kept;
  for (const Detection& detection : file->detections) {
    const std::vector<bool> placeholder = Placeholders(detection);
    dropped += std::count(placeholder.begin(), placeholder.end(), true);
    kept.push_back(Without(detection, placeholder));
    if (kept.back().num_corners() == 0) kept.pop_back();
  }
  if (dropped == 0) return;
  file->detections = std::move(kept);
  file->notes.push_back({"CAL-PLACEHOLDER",
                         std::to_string(dropped) +
                             " corners lie at 0 0, or exactly where another corner of the same view lies: "
                             "they count as corners that were not found",
                         "leave out corners that were not found, or write them as the format says"});
}

/// Column c of a row becomes cols - 1 - c; points change the sign of x. False for the kinds whose numbering has a meaning
/// beyond the grid.
bool Unmirror(int board_idx, CornerFile* file) {
  Board& board = file->boards[static_cast<size_t>(board_idx)];
  if (board.kind == Board::Kind::kPoints) {
    board.points.row(0) *= -1;
    return true;
  }
  if (board.has_tags() || board.kind == Board::Kind::kAsymmetricCircles) return false;
  for (Detection& detection : file->detections) {
    if (detection.board_idx != board_idx) continue;
    std::vector<std::pair<int, int>> order;  // new id, old position
    for (int i = 0; i < detection.num_corners(); ++i) {
      const int id = detection.corner_ids[static_cast<size_t>(i)];
      order.emplace_back(id / board.cols * board.cols + board.cols - 1 - id % board.cols, i);
    }
    std::sort(order.begin(), order.end());
    const Detection old = detection;
    for (int i = 0; i < old.num_corners(); ++i) {
      const auto [id, from] = order[static_cast<size_t>(i)];
      detection.corner_ids[static_cast<size_t>(i)] = id;
      detection.points_px.col(i) = old.points_px.col(from);
      if (old.sigmas_px.size() > 0) detection.sigmas_px[i] = old.sigmas_px[from];
    }
  }
  return true;
}

struct OrientationCount {
  int mirrored = 0, straight = 0;
};

void NoteMirroredCameras(const std::vector<OrientationCount>& counts, CornerFile* file) {
  for (size_t c = 0; c < counts.size(); ++c) {
    const int views = counts[c].mirrored + counts[c].straight;
    if (counts[c].mirrored < 3 || counts[c].mirrored < 0.95 * views) continue;
    file->notes.push_back(
        {"CAL-MIRRORED-CAMERA",
         "camera " + file->cameras[c].name + " sees the board mirrored in " + std::to_string(counts[c].mirrored) + " of " +
             std::to_string(views) + " views, other cameras do not",
         "fine for a board printed through or on both sides (how thick is said by two-sided=THICKNESS in option 'board'); "
         "otherwise this camera's images are flipped: turn its mirror mode off and film again"});
  }
}

/// Of the views of a board, by camera.
std::vector<OrientationCount> CountOrientations(const CornerFile& file, size_t board_idx) {
  std::vector<OrientationCount> counts(file.cameras.size());
  for (const Detection& detection : file.detections) {
    if (detection.board_idx != static_cast<int>(board_idx)) continue;
    const int sign = ViewOrientation(file.boards[board_idx], detection);
    counts[static_cast<size_t>(detection.camera_idx)].mirrored += sign < 0;
    counts[static_cast<size_t>(detection.camera_idx)].straight += sign > 0;
  }
  return counts;
}

OrientationCount Sum(const std::vector<OrientationCount>& counts) {
  OrientationCount sum;
  for (const OrientationCount& count : counts) sum.mirrored += count.mirrored, sum.straight += count.straight;
  return sum;
}

/// Numbers a board's corners the other way round when that makes its views straight; corners that contradict each other stay.
bool Straighten(size_t board_idx, CornerFile* file) {
  const std::vector<Detection> before = file->detections;
  if (!Unmirror(static_cast<int>(board_idx), file)) return false;
  const OrientationCount now = Sum(CountOrientations(*file, board_idx));
  if (now.mirrored < now.straight) return true;
  file->detections = before;
  return false;
}

/// Of a two-sided board, corners that run mirrored are those of the back.
void PutOnBack(size_t board_idx, CornerFile* file) {
  const Board& board = file->boards[board_idx];
  if (!board.back_m) return;
  for (Detection& detection : file->detections) {
    if (detection.board_idx != static_cast<int>(board_idx) || ViewOrientation(board, detection) >= 0) continue;
    for (int& id : detection.corner_ids) id = (id + board.num_side_corners()) % board.num_corners();
  }
}

/// Renumbers boards that are mirrored in every view; notes cameras that see only the back.
void CheckOrientation(CornerFile* file) {
  for (size_t b = 0; b < file->boards.size(); ++b) {
    PutOnBack(b, file);
    const std::vector<OrientationCount> counts = CountOrientations(*file, b);
    const auto [mirrored, straight] = Sum(counts);
    if (mirrored == 0) continue;
    if (straight > 0.05 * (mirrored + straight)) {
      NoteMirroredCameras(counts, file);
      continue;
    }
    const std::string text = "the corners of board " + std::to_string(b) + " run mirrored in " + std::to_string(mirrored) +
                             " of " + std::to_string(mirrored + straight) + " views";
    const bool mended = Straighten(b, file);
    file->notes.push_back(
        {"CAL-MIRRORED", text + (mended ? "; they are numbered the other way round from here on" : ""),
         "rows and columns swapped, or a y axis that points up, are the usual reasons; if the images themselves "
         "are mirrored, poses of cameras and boards come out mirrored too"});
  }
}

}  // namespace

int ViewOrientation(const Board& board, const Detection& detection) {
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  const Eigen::Index n = detection.points_px.cols();
  if (n < 3 || corners.cols() == 0) return 0;
  Eigen::Matrix3Xd x(3, n);
  for (Eigen::Index i = 0; i < n; ++i) x.col(i) = corners.col(detection.corner_ids[static_cast<size_t>(i)]);
  x.colwise() -= Eigen::Vector3d(x.rowwise().mean());
  const Eigen::Matrix2Xd xy = x.topRows<2>(), px = detection.points_px.colwise() - detection.points_px.rowwise().mean();
  if (x.row(2).cwiseAbs().maxCoeff() > 1e-3 * xy.cwiseAbs().maxCoeff()) return 0;
  const auto thin = [](const Eigen::Matrix2Xd& p) {
    const Eigen::Vector2d s = geometry::SingularValues(p);
    return !(s[1] > 1e-3 * s[0]);
  };
  if (thin(xy) || thin(px)) return 0;
  const Eigen::Matrix2d affine = (px * xy.transpose()) * (xy * xy.transpose()).inverse();
  const bool behind = board.back_m && detection.corner_ids[0] >= board.num_side_corners();
  return (affine.determinant() < 0) != behind ? -1 : 1;
}

Board BoardFromPoints(const Eigen::Matrix3Xd& points) {
  Board board;
  board.kind = Board::Kind::kPoints;
  board.points = points;
  const auto n = static_cast<int>(points.cols());
  if (n < 4) return board;
  const Eigen::Vector3d along_row = points.col(1) - points.col(0);
  const double step = along_row.norm();
  for (int cols = 2; step > 0 && cols <= n / 2; ++cols) {
    const Eigen::Vector3d along_column = points.col(cols) - points.col(0);
    const double row_step = along_column.norm();
    if (n % cols != 0 || !(row_step > 0) || std::abs(along_row.dot(along_column)) > 1e-4 * step * row_step) continue;
    double worst = 0;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d expected = points.col(0) + i % cols * along_row + i / cols * along_column;
      worst = std::max(worst, (points.col(i) - expected).norm() / (1 + i % cols + i / cols));
    }
    if (worst > 1e-4 * std::min(step, row_step)) continue;
    const auto rounded = [](double length) {
      const double micrometres = std::round(length * 1e6) / 1e6;
      return std::abs(micrometres - length) < 1e-6 * length ? micrometres : length;
    };
    const double width = (points.col(cols - 1) - points.col(0)).norm() / (cols - 1);
    const double height = (points.col(n - cols) - points.col(0)).norm() / (n / cols - 1);
    const bool square = std::abs(width - height) <= 1e-4 * width;
    board = Board();
    board.kind = Board::Kind::kGrid;
    board.cols = cols, board.rows = n / cols;
    board.square_m = rounded(square ? (points.col(n - 1) - points.col(0)).norm() / std::hypot(cols - 1, n / cols - 1) : width);
    if (!square) board.row_step_m = rounded(height);
    return board;
  }
  return board;
}

CornerFile ReadCornerFile(const std::string& path, const CornerFileOptions& options) {
  const CornerFormat format = options.format == CornerFormat::kAuto ? DetectCornerFormat(path) : options.format;
  CornerFile file;
  if (format == CornerFormat::kVnl) file = internal::ReadVnl(path, options);
  if (format == CornerFormat::kCaliscope) file = internal::ReadCaliscope(path, options);
  if (format == CornerFormat::kOpenCv) file = internal::ReadOpenCvCorners(path, options);
  if (format == CornerFormat::kCsv) file = internal::ReadCornerCsv(path, options);
  DropPlaceholders(&file);
  CheckCorners(path, file);
  ApplySizes(options, &file);
  CheckOrientation(&file);
  return file;
}

}  // namespace mvstudio::calib
