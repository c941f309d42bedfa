#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "calib/board/floor.h"
#include "calib/board/space_points.h"
#include "calib/check/seen_corners.h"
#include "calib/lens/resection.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/rig/free_boards.h"
#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "core/statistics.h"
#include "geometry/rig/rig_covariance.h"

/// What Calibrate is given, before anything is solved: checked, cameras split and in a fixed order, views made.
namespace mvstudio::calib::internal {
namespace {

/// Weights with mean 1, so that sigma_px is that of an average corner.
void NormalizeWeights(std::vector<View>* views) {
  double sum = 0;
  Eigen::Index count = 0;
  for (const View& view : *views) sum += view.weights.sum(), count += view.size();
  for (View& view : *views) view.weights *= sum > 0 ? static_cast<double>(count) / sum : 1;
}

bool ShowsBack(const CalibrateInput& input, const View& view) {
  return !view.corner_ids.empty() && view.corner_ids[0] >= input.boards[static_cast<size_t>(view.board)].num_side_corners();
}

}  // namespace

void TurnNumbering(CalibrateInput* input, Work* work, CalibrateReport* report) {
  const int num_turns = NumNumberings(input->boards);
  if (num_turns < 2) return;
  const Eigen::Matrix3Xd board = CornersInBoard(input->boards[0]);
  std::vector<View> views = work->views;
  std::vector<geometry::Rigid3> poses = work->cam_from_board;
  for (const View& view : work->held_out) {
    views.push_back(view);
    poses.push_back(ResectPlane(work->state.cameras[static_cast<size_t>(view.camera_idx)], view).cam_from_board);
  }
  const std::vector<int> rotated = FindRotatedViews(board, num_turns, views, poses);
  TurnViews(board, rotated, &views, &poses);
  const auto kept = static_cast<std::ptrdiff_t>(work->views.size());
  work->views.assign(views.begin(), views.begin() + kept), work->held_out.assign(views.begin() + kept, views.end());
  work->cam_from_board.assign(poses.begin(), poses.begin() + kept);
  std::map<std::pair<int, int64_t>, int> seen;  // by camera and frame: quarter turns
  for (const CameraInput& camera : input->cameras) report->rotated.push_back({camera.name});
  for (size_t v = 0; v < views.size(); ++v) {
    RotatedCamera& count = report->rotated[static_cast<size_t>(views[v].camera_idx)];
    count.num_rotated += rotated[v] != 0, ++count.num_views;
    if (rotated[v] != 0) seen[{views[v].camera_idx, work->frames[static_cast<size_t>(views[v].frame)]}] = rotated[v];
  }
  const auto none = [](const RotatedCamera& camera) { return camera.num_rotated == 0; };
  report->rotated.erase(std::remove_if(report->rotated.begin(), report->rotated.end(), none), report->rotated.end());
  std::vector<int> detections;
  for (const Detection& d : input->detections) {
    const auto found = seen.find({d.camera_idx, d.frame_idx});
    detections.push_back(found == seen.end() ? 0 : found->second);
  }
  TurnDetections(detections, input);
}

bool CheckUnitOfHeldPoses(const Work& work, CalibrateReport* report) {
  constexpr double kOther = 3, kAlike = 1.3, kApart = 0.02;  // of the board's distance
  std::map<int, std::vector<size_t>> of_frame;
  for (size_t v = 0; v < work.views.size(); ++v) of_frame[work.views[v].frame].push_back(v);
  std::map<std::pair<int, int>, std::vector<double>> factors;  // by pair of cameras
  for (const auto& [frame, views] : of_frame) {
    for (size_t i = 0; i < views.size(); ++i) {
      for (size_t k = i + 1; k < views.size(); ++k) {
        const View &a = work.views[views[i]], &b = work.views[views[k]];
        const auto &of_a = work.known_poses[static_cast<size_t>(a.camera_idx)],
                   &of_b = work.known_poses[static_cast<size_t>(b.camera_idx)];
        const auto held = [&](int c) { return work.bundle.fix_camera[static_cast<size_t>(c)]; };
        if (a.board != b.board || a.camera_idx == b.camera_idx || !held(a.camera_idx) || !held(b.camera_idx)) continue;
        const double seen_m =
            (work.cam_from_board[views[i]] * geometry::Inverse(work.cam_from_board[views[k]])).translation.norm();
        const double given_m = (*of_a * geometry::Inverse(*of_b)).translation.norm();
        if (seen_m > kApart * work.cam_from_board[views[i]].translation.norm())
          factors[{a.camera_idx, b.camera_idx}].push_back(given_m / seen_m);
      }
    }
  }
  std::vector<double> of_pairs;
  for (auto& [pair, all] : factors) of_pairs.push_back(UpperMedian(std::move(all)));
  if (of_pairs.empty()) return true;
  const auto [least, most] = std::minmax_element(of_pairs.begin(), of_pairs.end());
  if (*most > kAlike * *least || (*least<kOther&& * most> 1 / kOther)) return true;
  Stop(Status::kDegenerate,
       Format("the held poses are in another unit than the board: the cameras are %.4g times as far apart as the boards say; "
              "give the calibration's unit, or the board's size",
              UpperMedian(of_pairs)),
       report);
  return false;
}

void SeparateViews(Work* work) {
  RigState& state = work->state;
  state.frames.clear();
  for (size_t v = 0; v < work->views.size(); ++v) {
    state.frames.push_back(work->frames[work->views[v].frame]);
    work->views[v].frame = static_cast<int>(v);
  }
  state.rig_from_board.assign(state.rig_from_board.size(), geometry::Rigid3());
  state.cam_from_world.assign(state.cameras.size(), geometry::Rigid3());
  work->bundle.gauge = {Gauge::Kind::kNone, 0};
  work->bundle.refine_cameras = work->bundle.refine_boards = false;
}

bool UseBoardWorld(const CalibrateInput& input, const World& world, Work* work, CalibrateReport* report) {
  const auto frame =
      std::find(work->frames.begin(), work->frames.end(), world.frame_idx);  // the first board's, where each has its own
  const int index = static_cast<int>(frame - work->frames.begin());
  const bool seen = frame != work->frames.end() && *frame == world.frame_idx &&
                    std::any_of(work->views.begin(), work->views.end(), [&](const View& v) {
                      return v.frame == index && (v.board == 0 || !work->free_boards) && (v.weights.array() > 0).any();
                    });
  if (!seen) {
    Stop(Status::kTooFewViews,
         "the board was not seen in frame " + std::to_string(world.frame_idx) + ", which is to define the world", report);
    return false;
  }
  if (std::any_of(work->views.begin(), work->views.end(),
                  [&](const View& v) { return v.frame == index && ShowsBack(input, v); })) {
    Stop(Status::kDegenerate,
         "the board shows its back in frame " + std::to_string(world.frame_idx) +
             ", which is to define the world: name a frame where it lies face up",
         report);
    return false;
  }
  // A board lies on the floor; points in space have axes of their own.
  const bool in_space = input.boards[0].kind == Board::Kind::kPoints && SpansSpace(input.boards[0].points);
  const geometry::Rigid3 new_from_board = in_space ? geometry::Rigid3() : WorldFromFloorBoard();
  const geometry::Rigid3 new_from_old = new_from_board * geometry::Inverse(work->state.world_from_board[index]);
  for (geometry::Rigid3& world_from_board : work->state.world_from_board) world_from_board = new_from_old * world_from_board;
  for (geometry::Rigid3& cam_from_world : work->state.cam_from_world)
    cam_from_world = cam_from_world * geometry::Inverse(new_from_old);
  work->bundle.gauge = {Gauge::Kind::kBoard, index};
  return true;
}

World FindWorld(const WorldOrigin& origin, const std::vector<CameraInput>& cameras) {
  World world;
  world.is_board = origin.board_frame.has_value();
  world.frame_idx = origin.board_frame.value_or(0);
  if (world.is_board || origin.camera.empty()) return world;
  const auto found =
      std::find_if(cameras.begin(), cameras.end(), [&](const CameraInput& c) { return c.name == origin.camera; });
  if (found == cameras.end())
    throw UsageError("option 'world' " + ToString(origin) + ": there is no camera called '" + origin.camera + "'");
  world.camera = static_cast<int>(found - cameras.begin());
  return world;
}

void CheckInput(const CalibrateInput& input) {
  MVS_CHECK(!input.cameras.empty(), "no cameras");
  std::set<std::string> names;
  for (const CameraInput& camera : input.cameras) {
    MVS_CHECK(camera.width_px > 0 && camera.height_px > 0,
              "camera " << camera.name << " is " << camera.width_px << "x" << camera.height_px);
    if (!names.insert(camera.name).second) throw UsageError("camera '" + camera.name + "' is given twice");
  }
  std::set<std::tuple<int, int64_t, int>> seen;
  for (const Detection& d : input.detections) {
    MVS_CHECK(d.camera_idx >= 0 && d.camera_idx < static_cast<int>(input.cameras.size()),
              "detection of camera " << d.camera_idx);
    MVS_CHECK(seen.insert({d.camera_idx, d.frame_idx, d.board_idx}).second,
              "camera " << d.camera_idx << " has frame " << d.frame_idx << " twice");
  }
}

void MakeWork(const CalibrateInput& input, const CalibrateOptions& options, Work* work) {
  std::vector<View> all = MakeViews(input.boards, input.detections, &work->frames);
  NormalizeWeights(&all);
  const HoldoutRule& rule = options.holdout;
  for (View& view : all) {
    const auto& listed = input.held_out_frames;
    const bool named = std::find(listed.begin(), listed.end(), work->frames[view.frame]) != listed.end();
    const bool out = named || (rule.step > 0 && view.frame % rule.step == rule.first);
    (out ? work->held_out : work->views).push_back(std::move(view));
  }
  work->free_boards = options.free_boards == AutoOnOff::kOn && input.boards.size() > 1;
  if (work->free_boards) SeparateBoards({&work->views, &work->held_out}, &work->frames);
  for (const View& view : work->views) work->prior.push_back(view.weights);
  work->known_poses.resize(input.cameras.size());
  work->state.rig_from_board.resize(input.boards.size());
}

std::string LaterName(const CameraSplit& split) { return split.camera + "@" + std::to_string(split.frame_idx); }

void SplitCamera(const CameraSplit& split, CalibrateInput* input) {
  const auto found =
      std::find_if(input->cameras.begin(), input->cameras.end(), [&](const CameraInput& c) { return c.name == split.camera; });
  if (found == input->cameras.end())
    throw UsageError("option 'split-at' " + ToString(split) + ": there is no camera called '" + split.camera + "'");
  const int before = static_cast<int>(found - input->cameras.begin()), after = static_cast<int>(input->cameras.size());
  CameraInput later = *found;
  later.name = LaterName(split);
  input->cameras.push_back(later);
  if (!split.second_lens) input->same_lens.push_back({before, after});
  for (Detection& d : input->detections) {
    if (d.camera_idx == before && d.frame_idx >= split.frame_idx) d.camera_idx = after;
  }
}

std::vector<int> ByName(const CalibrateInput& input) {
  std::vector<int> order(input.cameras.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return input.cameras[a].name < input.cameras[b].name; });
  return order;
}

CalibrateInput Permuted(const CalibrateInput& input, const std::vector<int>& order) {
  CalibrateInput sorted = input;
  std::vector<int> position(order.size());
  for (size_t i = 0; i < order.size(); ++i)
    sorted.cameras[i] = input.cameras[order[i]], position[order[i]] = static_cast<int>(i);
  for (Detection& d : sorted.detections) d.camera_idx = position[d.camera_idx];
  for (std::vector<int>& group : sorted.same_lens) {
    for (int& camera : group) camera = position[camera];
  }
  std::stable_sort(sorted.detections.begin(), sorted.detections.end(), [](const Detection& a, const Detection& b) {
    return std::tie(a.camera_idx, a.frame_idx, a.board_idx) < std::tie(b.camera_idx, b.frame_idx, b.board_idx);
  });
  return sorted;
}

void RestoreOrder(const std::vector<int>& order, CalibrateReport* report) {
  const CalibrateReport sorted = *report;
  report->rig.joint_covariance = geometry::ReorderedJointCovariance(sorted.rig, order);
  for (size_t i = 0; i < order.size(); ++i) {
    if (!sorted.frame_shift.empty()) report->frame_shift[order[i]] = sorted.frame_shift[i];
    if (!sorted.frame_rates.empty()) report->frame_rates[order[i]] = sorted.frame_rates[i];
    if (!sorted.rig.cameras.empty()) report->rig.cameras[order[i]] = sorted.rig.cameras[i];
    if (!sorted.cameras.empty()) report->cameras[order[i]] = sorted.cameras[i];
    if (!sorted.uncertainty_maps.empty()) report->uncertainty_maps[order[i]] = sorted.uncertainty_maps[i];
    if (!sorted.uncertainty.cameras.empty()) report->uncertainty.cameras[order[i]] = sorted.uncertainty.cameras[i];
  }
  for (int& camera : report->suspects) camera = order[camera];
  for (FrameDrop& drop : report->frame_drops) drop.camera_idx = order[static_cast<size_t>(drop.camera_idx)];
  for (CornerResidual& residual : report->residuals) residual.camera_idx = order[residual.camera_idx];
  for (auto& component : report->components) {
    for (int& camera : component) camera = order[camera];
    std::sort(component.begin(), component.end());
  }
}

}  // namespace mvstudio::calib::internal
