#include "calib/check/seen_corners.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "calib/bundle/board_shape.h"
#include "calib/bundle/view.h"
#include "calib/lens/resection.h"
#include "calib/rig/frame_drops.h"
#include "calib/rig/frame_offset.h"
#include "core/error.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kLeastTimeOffset = 0.005;  // frames; below it an offset moves nothing that an image shows
constexpr size_t kMinCorners = 6;           // of a view with a pose

/// Places of one camera's corners of one board: frame -> corner -> px.
using Track = std::map<int64_t, std::map<int, Eigen::Vector2d>>;

bool Matters(const geometry::TimeOffset& offset) { return std::abs(offset.frames) >= kLeastTimeOffset || offset.rate != 0; }

/// Which of a camera's images say how a corner moves: as MotionModel of the adjustment.
MotionModel MotionOf(const Track& track) {
  std::vector<int64_t> gaps;
  for (auto it = track.begin(); it != track.end() && std::next(it) != track.end(); ++it)
    gaps.push_back(std::next(it)->first - it->first);
  const int64_t gap = UpperMedian(std::move(gaps), int64_t{1});
  return gap > 1 ? MotionModel{2 * gap, 2, gap} : MotionModel();
}

/// The image with the corner that was taken nearest to a time, up to `reach` frames away; the end of the track: none.
Track::const_iterator Nearest(const Track& track, int corner, double time, double reach) {
  auto best = track.end();
  for (auto it = track.lower_bound(static_cast<int64_t>(std::floor(time - reach))); it != track.end(); ++it) {
    if (static_cast<double>(it->first) > time + reach) break;
    const double apart = std::abs(static_cast<double>(it->first) - time);
    const bool nearer = best == track.end() || apart < std::abs(static_cast<double>(best->first) - time);
    if (apart <= reach && nearer && it->second.count(corner) > 0) best = it;
  }
  return best;
}

/// Where the corner was at a time of this camera's frames: on the polynomial through its places in the images around it.
std::optional<Eigen::Vector2d> PlaceAt(const Track& track, const MotionModel& motion, int corner, double time) {
  const auto at = Nearest(track, corner, time, static_cast<double>(motion.gap));
  if (at == track.end()) return std::nullopt;
  std::vector<std::pair<double, Eigen::Vector2d>> places = {{static_cast<double>(at->first), at->second.at(corner)}};
  const auto look = [&](auto from, auto end) {
    int found = 0;
    for (auto it = from; it != end && found < motion.neighbours && std::llabs(it->first - at->first) <= motion.reach; ++it) {
      const auto place = it->second.find(corner);
      if (place == it->second.end()) continue;
      places.emplace_back(static_cast<double>(it->first), place->second);
      ++found;
    }
  };
  look(std::make_reverse_iterator(at), track.rend());
  look(std::next(at), track.end());
  if (places.size() < 2) return std::nullopt;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const auto& [frame, place] : places) {
    double share = 1;  // Lagrange
    for (const auto& [other, unused] : places) {
      if (other != frame) share *= (time - other) / (frame - other);
    }
    sum += share * place;
  }
  return sum;
}

/// A camera of the rig that is a part of another: NAME@FRAME.
struct Part {
  std::string name, whole;
  int64_t frame_idx = 0;
};

/// Parts of the input's cameras that the input does not name itself, the last first.
std::vector<Part> PartsIn(const geometry::Rig& rig, const CalibrateInput& input) {
  std::vector<Part> parts;
  const auto given = [&](const std::string& name) {
    return std::any_of(input.cameras.begin(), input.cameras.end(), [&](const CameraInput& c) { return c.name == name; });
  };
  for (const geometry::RigCamera& camera : rig.cameras) {
    const std::string& name = camera.camera.name;
    const size_t at = name.rfind('@');
    if (at == std::string::npos || at + 1 == name.size() || given(name)) continue;
    if (name.find_first_not_of("0123456789", at + 1) != std::string::npos || name.size() - at > 18) continue;
    const std::string whole = name.substr(0, at);
    if (given(whole) && rig.Find(whole) >= 0) parts.push_back({name, whole, std::stoll(name.substr(at + 1))});
  }
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.frame_idx > b.frame_idx; });
  return parts;
}

void DistinguishParts(const geometry::Rig& rig, CameraParts how, CalibrateInput* input) {
  for (const Part& part : PartsIn(rig, *input)) {
    const auto found =
        std::find_if(input->cameras.begin(), input->cameras.end(), [&](const CameraInput& c) { return c.name == part.whole; });
    if (found == input->cameras.end()) continue;  // a later part has all of it
    if (how == CameraParts::kLast) {
      found->name = part.name;
      continue;
    }
    const int before = static_cast<int>(found - input->cameras.begin()), after = static_cast<int>(input->cameras.size());
    CameraInput later = *found;
    later.name = part.name;
    input->cameras.push_back(later);
    for (Detection& d : input->detections) {
      if (d.camera_idx == before && d.frame_idx >= part.frame_idx) d.camera_idx = after;
    }
  }
}

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// The input without cameras that the rig lacks.
CalibrateInput KnownCameras(const geometry::Rig& rig, const CalibrateInput& input, std::vector<std::string>* unknown) {
  std::vector<int> known;
  for (size_t c = 0; c < input.cameras.size(); ++c) {
    const CameraInput& camera = input.cameras[c];
    const int found = rig.Find(camera.name);
    if (found < 0) unknown->push_back(camera.name);
    if (found < 0) continue;
    known.push_back(static_cast<int>(c));
    const geometry::Camera& lens = rig.cameras[static_cast<size_t>(found)].camera;
    if (camera.width_px > 0 && (camera.width_px != lens.width_px || camera.height_px != lens.height_px))
      throw UsageError("camera " + camera.name + ": its images have " + SizeText(camera.width_px, camera.height_px) +
                       " px, the calibration is for " + SizeText(lens.width_px, lens.height_px));
  }
  return unknown->empty() ? input : InputOf(input, known);
}

/// Views of the detections that have a pose by themselves.
struct PosedViews {
  std::vector<View> views;
  std::vector<Rigid3> cam_from_board;
  std::vector<size_t> detection;  // of each view
  std::vector<int64_t> frames;
};

PosedViews PoseViews(const geometry::Rig& rig, const CalibrateInput& input) {
  PosedViews posed;
  const std::vector<View> all = MakeViews(input.boards, input.detections, &posed.frames);
  std::vector<Eigen::Matrix3Xd> shaped;
  for (const Board& board : input.boards) shaped.push_back(ShapedCorners(board, rig.boards));
  for (size_t d = 0; d < all.size(); ++d) {
    View view = all[d];
    if (static_cast<size_t>(view.size()) < kMinCorners) continue;
    view.x_in_board = shaped[static_cast<size_t>(view.board)](Eigen::all, view.corner_ids);
    const int lens = rig.Find(input.cameras[static_cast<size_t>(view.camera_idx)].name);
    const Resection pose = ResectPlane(rig.cameras[static_cast<size_t>(lens)].camera, view);
    if (pose.status != Status::kOk && pose.status != Status::kNotConverged) continue;
    posed.views.push_back(std::move(view)), posed.cam_from_board.push_back(pose.cam_from_board);
    posed.detection.push_back(d);
  }
  return posed;
}

/// Turns views that number the board from the other end, poses with them.
void TurnSeen(const geometry::Rig& rig, CalibrateInput* input, PosedViews* posed, CornerFindings* findings) {
  findings->rotated.clear();
  const int num_turns = NumNumberings(input->boards);
  if (num_turns < 2) return;
  const Eigen::Matrix3Xd board = CornersInBoard(input->boards[0]);
  std::vector<Rigid3> cam_from_world;
  for (const CameraInput& camera : input->cameras)
    cam_from_world.push_back(rig.cameras[static_cast<size_t>(rig.Find(camera.name))].cam_from_world);
  const std::vector<int> views = FindRotatedViews(board, num_turns, posed->views, posed->cam_from_board, &cam_from_world);
  std::vector<int> detections(input->detections.size(), 0);
  std::vector<RotatedCamera> counts;
  for (const CameraInput& camera : input->cameras) counts.push_back({camera.name});
  for (size_t v = 0; v < views.size(); ++v) {
    detections[posed->detection[v]] = views[v];
    RotatedCamera& count = counts[static_cast<size_t>(posed->views[v].camera_idx)];
    count.num_rotated += views[v] != 0, ++count.num_views;
  }
  for (const RotatedCamera& camera : counts) {
    if (camera.num_rotated > 0) findings->rotated.push_back(camera);
  }
  TurnDetections(detections, input);
  TurnViews(board, views, &posed->views, &posed->cam_from_board);
}

std::vector<std::string> NamesOf(const CalibrateInput& input) {
  std::vector<std::string> names;
  for (const CameraInput& camera : input.cameras) names.push_back(camera.name);
  return names;
}

FrameOffsets OffsetsOf(const CalibrateInput& input, const PosedViews& posed) {
  return FindFrameOffsets(posed.views, posed.cam_from_board, posed.frames, NamesOf(input), {TurnsOf(input.boards)});
}

}  // namespace

void TurnDetections(const std::vector<int>& rotated, CalibrateInput* input) {
  const int num_corners = input->boards.at(0).num_corners();
  for (size_t d = 0; d < rotated.size(); ++d) {
    for (int& id : input->detections[d].corner_ids) id = RotatedCorner(id, num_corners, rotated[d]);
  }
}

CalibrateInput AtFrameTimes(CalibrateInput input, const std::vector<geometry::TimeOffset>& late) {
  std::map<std::pair<int, int>, Track> tracks;  // by camera and board
  const auto is_late = [&](const Detection& d) {
    const auto c = static_cast<size_t>(d.camera_idx);
    return c < late.size() && Matters(late[c]);
  };
  for (const Detection& d : input.detections) {
    if (!is_late(d)) continue;
    auto& places = tracks[{d.camera_idx, d.board_idx}][d.frame_idx];
    for (int i = 0; i < d.num_corners(); ++i) places[d.corner_ids[static_cast<size_t>(i)]] = d.points_px.col(i);
  }
  for (Detection& d : input.detections) {
    if (!is_late(d)) continue;
    const Track& track = tracks.at({d.camera_idx, d.board_idx});
    const double frame = static_cast<double>(d.frame_idx), time = frame - late[static_cast<size_t>(d.camera_idx)].At(frame);
    const MotionModel motion = MotionOf(track);
    for (int i = 0; i < d.num_corners(); ++i) {
      if (const auto place = PlaceAt(track, motion, d.corner_ids[static_cast<size_t>(i)], time)) d.points_px.col(i) = *place;
    }
  }
  return input;
}

CalibrateInput InputOf(const CalibrateInput& input, const std::vector<int>& cameras) {
  CalibrateInput part = input;
  part.cameras.clear(), part.detections.clear(), part.same_lens.clear();
  std::vector<int> place(input.cameras.size(), -1);
  for (const int c : cameras) {
    place[static_cast<size_t>(c)] = static_cast<int>(part.cameras.size());
    part.cameras.push_back(input.cameras[static_cast<size_t>(c)]);
  }
  for (Detection detection : input.detections) {
    detection.camera_idx = place[static_cast<size_t>(detection.camera_idx)];
    if (detection.camera_idx >= 0) part.detections.push_back(std::move(detection));
  }
  for (const std::vector<int>& group : input.same_lens) {
    std::vector<int> kept;
    for (const int c : group) {
      if (place[static_cast<size_t>(c)] >= 0) kept.push_back(place[static_cast<size_t>(c)]);
    }
    if (kept.size() > 1) part.same_lens.push_back(kept);
  }
  return part;
}

CalibrateInput SeenCorners(const geometry::Rig& rig, const CalibrateInput& input, CameraParts parts, CornerFindings* findings) {
  CalibrateInput given = input;
  DistinguishParts(rig, parts, &given);
  given = KnownCameras(rig, given, &findings->unknown);
  CalibrateInput seen = given;
  PosedViews posed = PoseViews(rig, seen);
  TurnSeen(rig, &seen, &posed, findings);
  if (given.cameras.size() < 2) return seen;
  FrameOffsets offsets = OffsetsOf(given, posed);
  CalibrateInput numbered = given;
  if (const auto drops = FindFrameDrops(offsets); !drops.empty()) {
    CalibrateInput continued = given;
    ApplyFrameDrops(drops, &continued.detections);
    const FrameOffsets after = OffsetsOf(continued, PoseViews(rig, continued));
    if (after.kind == FrameOffsets::Kind::kInconsistent) return seen;
    findings->frame_drops = drops;
    findings->numbers_text = ToString(drops, NamesOf(given)) + "; they were renumbered";
    offsets = after, numbered = std::move(continued);
  }
  if (offsets.kind == FrameOffsets::Kind::kShifted) {
    findings->frame_shift = offsets.shift;
    findings->numbers_text += (findings->numbers_text.empty() ? "" : "; ") + offsets.text + "; they were added";
    ApplyFrameOffsets(offsets, &numbered.detections);
  }
  if (findings->numbers_text.empty()) return seen;
  posed = PoseViews(rig, numbered);
  TurnSeen(rig, &numbered, &posed, findings);
  return numbered;
}

bool HasParts(const geometry::Rig& rig, const CalibrateInput& input) { return !PartsIn(rig, input).empty(); }

std::vector<geometry::TimeOffset> StatedTimeOffsets(const geometry::Rig& rig, const CalibrateInput& input) {
  std::vector<geometry::TimeOffset> late;
  for (const CameraInput& camera : input.cameras) {
    const int found = rig.Find(camera.name);
    const auto* stated = found >= 0 ? &rig.cameras[static_cast<size_t>(found)].time_offset : nullptr;
    late.push_back(stated && *stated ? **stated : geometry::TimeOffset());
    late.back().frames = -late.back().frames, late.back().rate = -late.back().rate;
  }
  return std::any_of(late.begin(), late.end(), Matters) ? late : std::vector<geometry::TimeOffset>();
}

}  // namespace mvstudio::calib
