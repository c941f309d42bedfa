#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>

#include "calib/calibrate_steps.h"
#include "core/check.h"
#include "core/error.h"
#include "geometry/rig/rig_covariance.h"

/// What Calibrate is given, before anything is solved: checked, cameras split and in a fixed order, views made.
namespace mvstudio::calib::internal {
namespace {

struct HoldoutRule {
  int step = 0, first = 0;  // of time steps; step 0: none
};

/// `holdout`: every:N or every:N:K.
HoldoutRule ParseHoldout(const std::string& text) {
  if (text.empty()) return {};
  const auto number = [](const std::string& digits) {
    const bool ok = !digits.empty() && digits.size() <= 6 && digits.find_first_not_of("0123456789") == std::string::npos;
    return ok ? std::stoi(digits) : -1;
  };
  const std::string rest = text.rfind("every:", 0) == 0 ? text.substr(6) : "";
  const auto colon = rest.find(':');
  HoldoutRule rule;
  rule.step = number(rest.substr(0, colon));
  rule.first = colon == std::string::npos ? rule.step - 1 : number(rest.substr(colon + 1));
  if (rule.step < 2 || rule.first < 0 || rule.first >= rule.step)
    throw UsageError("option 'holdout' " + text + ": expected every:N with N at least 2, or every:N:K with K from 0 to N - 1");
  return rule;
}

/// Weights with mean 1, so that sigma_px is that of an average corner.
void NormalizeWeights(std::vector<View>* views) {
  double sum = 0;
  Eigen::Index count = 0;
  for (const View& view : *views) sum += view.weights.sum(), count += view.size();
  for (View& view : *views) view.weights *= sum > 0 ? static_cast<double>(count) / sum : 1;
}

struct SplitAt {
  std::string name;
  int64_t frame = 0;
  bool own_lens = false;
};

/// "NAME:FRAME" or "NAME:FRAME:lens"; names may hold colons.
SplitAt ParseSplit(const std::string& text) {
  SplitAt split;
  std::string rest = text;
  const std::string suffix = ":lens";
  if (rest.size() > suffix.size() && rest.compare(rest.size() - suffix.size(), suffix.size(), suffix) == 0) {
    split.own_lens = true;
    rest.resize(rest.size() - suffix.size());
  }
  const auto colon = rest.rfind(':');
  const std::string frame = colon == std::string::npos ? "" : rest.substr(colon + 1);
  if (frame.empty() || frame.size() > 9 || frame.find_first_not_of("0123456789") != std::string::npos)
    throw UsageError("option 'split-at' " + text + ": expected CAMERA:FRAME or CAMERA:FRAME:lens");
  split.name = rest.substr(0, colon);
  split.frame = std::stoll(frame);
  return split;
}

}  // namespace

World ParseWorld(const std::string& text, const std::vector<CameraInput>& cameras) {
  World world;
  const auto colon = text.find(':');
  const std::string kind = text.substr(0, colon), value = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (kind == "camera") {
    if (value.empty()) return world;
    const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const CameraInput& c) { return c.name == value; });
    if (found == cameras.end()) throw UsageError("option 'world' " + text + ": there is no camera called '" + value + "'");
    world.camera = static_cast<int>(found - cameras.begin());
    return world;
  }
  if (kind != "board" || value.empty() || value.find_first_not_of("0123456789") != std::string::npos || value.size() > 9) {
    throw UsageError("option 'world' " + text + ": expected camera, camera:NAME or board:FRAME");
  }
  world.is_board = true;
  world.frame_idx = std::stoll(value);
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
  const HoldoutRule rule = ParseHoldout(options.holdout);
  for (View& view : all) {
    const auto& listed = input.held_out_frames;
    const bool named = std::find(listed.begin(), listed.end(), work->frames[view.frame]) != listed.end();
    const bool out = named || (rule.step > 0 && view.frame % rule.step == rule.first);
    (out ? work->held_out : work->views).push_back(std::move(view));
  }
  for (const View& view : work->views) work->prior.push_back(view.weights);
  work->known_poses.resize(input.cameras.size());
  work->state.rig_from_board.resize(input.boards.size());
}

/// The camera's later frames become those of another camera.
void SplitCamera(const std::string& text, CalibrateInput* input) {
  const SplitAt split = ParseSplit(text);
  const auto found =
      std::find_if(input->cameras.begin(), input->cameras.end(), [&](const CameraInput& c) { return c.name == split.name; });
  if (found == input->cameras.end())
    throw UsageError("option 'split-at' " + text + ": there is no camera called '" + split.name + "'");
  const int before = static_cast<int>(found - input->cameras.begin()), after = static_cast<int>(input->cameras.size());
  CameraInput later = *found;
  later.name += "@" + std::to_string(split.frame);
  input->cameras.push_back(later);
  if (!split.own_lens) input->same_lens.push_back({before, after});
  for (Detection& d : input->detections) {
    if (d.camera_idx == before && d.frame_idx >= split.frame) d.camera_idx = after;
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
    if (!sorted.rig.cameras.empty()) report->rig.cameras[order[i]] = sorted.rig.cameras[i];
    if (!sorted.cameras.empty()) report->cameras[order[i]] = sorted.cameras[i];
    if (!sorted.uncertainty_maps.empty()) report->uncertainty_maps[order[i]] = sorted.uncertainty_maps[i];
    if (!sorted.uncertainty.cameras.empty()) report->uncertainty.cameras[order[i]] = sorted.uncertainty.cameras[i];
  }
  for (CornerResidual& residual : report->residuals) residual.camera_idx = order[residual.camera_idx];
  for (auto& component : report->components) {
    for (int& camera : component) camera = order[camera];
    std::sort(component.begin(), component.end());
  }
}

}  // namespace mvstudio::calib::internal
