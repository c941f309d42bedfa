#include "calib/verdict/capture_advice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <utility>

#include "core/check.h"

namespace mvstudio::calib {
namespace {

using Eigen::Index;
using geometry::Rigid3;

constexpr int kCols = 10, kRows = 8;
constexpr int kEnoughShared = 5, kEnoughViews = 8;
constexpr double kFilled = 1.0 / 3;
constexpr double kTiltedRad = 15 * M_PI / 180, kTiltedShare = 0.1;
constexpr double kRangeRatio = 1.3;

/// One part of the image, cells [col, col_end) x [row, row_end).
struct Part {
  const char* name;
  int col, col_end, row, row_end;
};

constexpr std::array<Part, 9> kParts = {{{"top-left corner", 0, 3, 0, 3},
                                         {"top-right corner", 7, 10, 0, 3},
                                         {"bottom-left corner", 0, 3, 5, 8},
                                         {"bottom-right corner", 7, 10, 5, 8},
                                         {"left side", 0, 3, 3, 5},
                                         {"right side", 7, 10, 3, 5},
                                         {"top", 3, 7, 0, 3},
                                         {"bottom", 3, 7, 5, 8},
                                         {"middle", 3, 7, 3, 5}}};

std::string Metres(double m) {
  std::ostringstream text;
  text.precision(2);
  if (m >= 100) text.precision(static_cast<std::streamsize>(std::log10(m)) + 1);
  text << m << " m";
  return text.str();
}

/// "a", "a and b", "a, b and c".
std::string List(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

/// The four corners, and the four sides, of kParts by one name where all of them are meant.
std::vector<std::string> InGroups(std::vector<std::string> names) {
  const std::pair<size_t, const char*> groups[] = {{0, "all four corners"}, {4, "all four sides"}};
  for (const auto& [first, all] : groups) {
    const auto begin = std::find(names.begin(), names.end(), std::string("the ") + kParts[first].name);
    if (std::distance(begin, names.end()) < 4 || begin[3] != std::string("the ") + kParts[first + 3].name) continue;
    *begin = all;
    names.erase(begin + 1, begin + 4);
  }
  return names;
}

struct Weighted {
  double urgency;
  FilmHint hint;
};

/// What one camera saw.
struct Seen {
  int num_views = 0, num_posed = 0;
  std::array<bool, kCols * kRows> cells{};
  std::array<int, 2> num_tilted{};           // about the image's vertical axis, about the horizontal one
  std::array<double, 2> largest_tilt_rad{};  // the same
  double nearest_m = std::numeric_limits<double>::infinity(), farthest_m = 0;
};

Seen Collect(const geometry::Camera& camera, int camera_idx, const std::vector<FilmedBoard>& boards) {
  Seen seen;
  for (const FilmedBoard& board : boards) {
    if (board.camera_idx != camera_idx || board.px.cols() == 0) continue;
    ++seen.num_views;
    for (Index i = 0; i < board.px.cols(); ++i) {
      const int col = static_cast<int>(std::clamp((board.px(0, i) + 0.5) * kCols / camera.width_px, 0.0, kCols - 1.0));
      const int row = static_cast<int>(std::clamp((board.px(1, i) + 0.5) * kRows / camera.height_px, 0.0, kRows - 1.0));
      seen.cells[row * kCols + col] = true;
    }
    if (board.range_m > 0) {
      seen.nearest_m = std::min(seen.nearest_m, board.range_m);
      seen.farthest_m = std::max(seen.farthest_m, board.range_m);
    }
    if (!board.cam_from_board) continue;
    ++seen.num_posed;
    const Eigen::Vector3d normal = board.cam_from_board->rotation * Eigen::Vector3d::UnitZ();
    for (int axis = 0; axis < 2; ++axis) {  // about the vertical axis the normal turns along x
      const double tilt = std::abs(std::atan2(normal[axis], std::abs(normal.z())));
      seen.num_tilted[axis] += tilt >= kTiltedRad;
      seen.largest_tilt_rad[axis] = std::max(seen.largest_tilt_rad[axis], tilt);
    }
  }
  return seen;
}

const char* AxisName(int axis) { return axis == 0 ? "vertical" : "horizontal"; }

void HintFew(const std::string& camera, int camera_idx, const Seen& seen, std::vector<Weighted>* hints) {
  if (seen.num_views >= kEnoughViews) return;
  std::ostringstream text;
  text << "camera " << camera << ": " << seen.num_views << (seen.num_views == 1 ? " board" : " boards") << " only: show "
       << kEnoughViews << " or more, in different places, distances and tilts";
  hints->push_back({2000 - static_cast<double>(seen.num_views), {"FILM-FEW", camera_idx, text.str(), ""}});
}

void HintCoverage(const std::string& camera, int camera_idx, const Seen& seen, std::vector<Weighted>* hints) {
  std::vector<std::string> names;
  int empty = 0, total = 0, parts = 0;
  for (const Part& part : kParts) {
    int filled = 0;
    const int size = (part.col_end - part.col) * (part.row_end - part.row);
    for (int row = part.row; row < part.row_end; ++row) {
      for (int col = part.col; col < part.col_end; ++col) filled += seen.cells[row * kCols + col];
    }
    if (filled >= kFilled * size) continue;
    names.push_back(std::string("the ") + part.name);
    empty += size - filled, total += size, ++parts;
  }
  if (names.empty() || seen.num_views == 0) return;
  names = InGroups(std::move(names));
  std::ostringstream text;
  text << "camera " << camera << ": " << List(names) << " of the image " << (parts == 1 ? "holds" : "hold") << ' '
       << (empty == total ? "no corners" : "almost no corners") << " (" << empty << " of the image's " << kCols * kRows
       << " cells are empty there): show the board there";
  if (seen.num_posed > 0) {
    const int axis = seen.num_tilted[0] <= seen.num_tilted[1] ? 0 : 1;
    text << ", tilted about its " << AxisName(axis) << " axis";
  }
  if (seen.farthest_m > 0) text << "; the nearest board was " << Metres(seen.nearest_m) << " away";
  hints->push_back({100 + static_cast<double>(empty),
                    {"FILM-COVERAGE", camera_idx, text.str(), "show the board at " + List(names) + " of the image"}});
}

void HintTilt(const std::string& camera, int camera_idx, const Seen& seen, std::vector<Weighted>* hints) {
  for (int axis = 0; axis < 2 && seen.num_posed > 0; ++axis) {
    if (seen.num_tilted[axis] >= 2 && seen.num_tilted[axis] >= kTiltedShare * seen.num_posed) continue;
    std::ostringstream text;
    text << "camera " << camera << ": " << seen.num_tilted[axis] << " of " << seen.num_posed
         << " boards are tilted by 15 degrees or more about the " << AxisName(axis) << " axis (the largest tilt is "
         << std::lround(seen.largest_tilt_rad[axis] * 180 / M_PI) << "): tilt the board 30 to 45 degrees "
         << (axis == 0 ? "to the left and to the right" : "up and down");
    hints->push_back({90 - 10.0 * seen.num_tilted[axis] / seen.num_posed, {"FILM-TILT", camera_idx, text.str(), ""}});
  }
}

void HintRange(const std::string& camera, int camera_idx, const Seen& seen, std::vector<Weighted>* hints) {
  if (seen.farthest_m <= 0 || seen.num_views < 2 || seen.farthest_m >= kRangeRatio * seen.nearest_m) return;
  hints->push_back({70,
                    {"FILM-RANGE", camera_idx,
                     "camera " + camera + ": all boards are " + Metres(seen.nearest_m) + " to " + Metres(seen.farthest_m) +
                         " away: show the board nearer, so that it fills half of the image, and twice as far",
                     ""}});
}

/// Frames in which both cameras see a board.
std::map<std::pair<int, int>, int> SharedFrames(const std::vector<FilmedBoard>& boards) {
  std::map<int64_t, std::set<int>> cameras_of;
  for (const FilmedBoard& board : boards) {
    if (board.px.cols() > 0) cameras_of[board.frame_idx].insert(board.camera_idx);
  }
  std::map<std::pair<int, int>, int> shared;
  for (const auto& [frame, cameras] : cameras_of) {
    for (auto a = cameras.begin(); a != cameras.end(); ++a) {
      for (auto b = std::next(a); b != cameras.end(); ++b) ++shared[{*a, *b}];
    }
  }
  return shared;
}

void HintLinks(const std::vector<geometry::Camera>& cameras, const std::vector<FilmedBoard>& boards,
               std::vector<Weighted>* hints) {
  const std::map<std::pair<int, int>, int> shared = SharedFrames(boards);
  std::vector<std::pair<int, std::pair<int, int>>> links;  // frames, cameras
  for (int a = 0; a < static_cast<int>(cameras.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(cameras.size()); ++b) {
      const auto found = shared.find({a, b});
      links.push_back({found == shared.end() ? 0 : found->second, {a, b}});
    }
  }
  std::stable_sort(links.begin(), links.end(), [](const auto& x, const auto& y) { return x.first > y.first; });
  std::vector<int> group(cameras.size());
  std::iota(group.begin(), group.end(), 0);
  for (const auto& [frames, pair] : links) {
    const int from = group[pair.second], to = group[pair.first];
    if (from == to) continue;
    std::replace(group.begin(), group.end(), from, to);
    if (frames >= kEnoughShared) continue;
    std::ostringstream text;
    text << "cameras " << cameras[pair.first].name << " and " << cameras[pair.second].name << " see the board together in "
         << (frames == 0   ? "no frame"
             : frames == 1 ? "1 frame"
                           : std::to_string(frames) + " frames")
         << ", their strongest link to each other: show it to both at once in " << kEnoughShared << " places or more";
    hints->push_back({3000 - static_cast<double>(frames), {"FILM-LINK", pair.second, text.str(), ""}});
  }
}

}  // namespace

std::vector<FilmedBoard> FilmedBoards(const std::vector<View>& views, const RigState& state) {
  std::vector<FilmedBoard> boards;
  for (const View& view : views) {
    std::vector<Index> kept;
    for (Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] > 0) kept.push_back(i);
    }
    if (kept.empty()) continue;
    const Rigid3 cam_from_board = CamFromBoard(view, state);
    const Eigen::Matrix3Xd x_in_board = view.x_in_board(Eigen::all, kept);
    boards.push_back({view.camera_idx, state.frames[view.frame], view.px(Eigen::all, kept), cam_from_board,
                      (cam_from_board * Eigen::Vector3d(x_in_board.rowwise().mean())).norm()});
  }
  return boards;
}

std::vector<FilmedBoard> FilmedBoards(const CalibrateReport& report) {
  std::map<int64_t, int> index_of_frame;  // -1 where a number stands for several frames
  for (size_t f = 0; f < report.frames.size(); ++f) {
    const auto [entry, is_new] = index_of_frame.insert({report.frames[f], static_cast<int>(f)});
    if (!is_new) entry->second = -1;
  }
  std::map<std::pair<int64_t, int>, std::vector<Eigen::Vector2d>> corners;
  for (const CornerResidual& corner : report.residuals) {
    if (!corner.rejected) corners[{corner.frame_idx, corner.camera_idx}].push_back(corner.px);
  }
  std::vector<FilmedBoard> boards;
  for (const auto& [place, points] : corners) {
    FilmedBoard board{place.second, place.first, Eigen::Matrix2Xd(2, points.size()), std::nullopt, 0};
    for (size_t i = 0; i < points.size(); ++i) board.px.col(static_cast<Index>(i)) = points[i];
    const auto frame = index_of_frame.find(place.first);
    const bool posed = frame != index_of_frame.end() && frame->second >= 0 &&
                       frame->second < static_cast<int>(report.world_from_board.size()) &&
                       place.second < static_cast<int>(report.rig.cameras.size());
    if (posed) {
      board.cam_from_board = report.rig.cameras[place.second].cam_from_world * report.world_from_board[frame->second];
      board.range_m = board.cam_from_board->translation.norm();
    }
    boards.push_back(std::move(board));
  }
  return boards;
}

std::vector<FilmHint> CaptureAdvice(const std::vector<geometry::Camera>& cameras, const std::vector<FilmedBoard>& boards,
                                    bool as_rig) {
  for (const FilmedBoard& board : boards) {
    MVS_CHECK(board.camera_idx >= 0 && board.camera_idx < static_cast<int>(cameras.size()), "camera " << board.camera_idx);
  }
  std::vector<Weighted> hints;
  if (as_rig) HintLinks(cameras, boards, &hints);
  for (int c = 0; c < static_cast<int>(cameras.size()); ++c) {
    const Seen seen = Collect(cameras[c], c, boards);
    HintFew(cameras[c].name, c, seen, &hints);
    HintCoverage(cameras[c].name, c, seen, &hints);
    HintTilt(cameras[c].name, c, seen, &hints);
    HintRange(cameras[c].name, c, seen, &hints);
  }
  std::stable_sort(hints.begin(), hints.end(), [](const Weighted& a, const Weighted& b) { return a.urgency > b.urgency; });
  std::vector<FilmHint> result;
  for (Weighted& weighted : hints) result.push_back(std::move(weighted.hint));
  return result;
}

std::vector<FilmHint> CaptureAdvice(const CalibrateReport& report) {
  std::vector<geometry::Camera> cameras;
  for (const geometry::RigCamera& camera : report.rig.cameras) cameras.push_back(camera.camera);
  return CaptureAdvice(cameras, FilmedBoards(report), !report.components.empty());
}

}  // namespace mvstudio::calib
