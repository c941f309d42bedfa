#include "triangulate/take/cause_trials.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "geometry/rig/meeting.h"
#include "geometry/rig/plausible.h"
#include "triangulate/sync/sync.h"

namespace mvstudio::triangulate::internal {
namespace {

using geometry::Camera;
using geometry::Rig;

/// What another lens than the given one would be; false: this camera is not concerned.
using ChangeLens = std::function<bool(Camera*)>;

/// The rig, without covariances, with the lens of one camera, or of all with -1, changed; nothing when that concerns none.
std::optional<Rig> WithLens(const Rig& rig, const ChangeLens& change, int only) {
  Rig changed;
  bool any = false;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    changed.cameras.push_back({rig.cameras[c].camera, rig.cameras[c].cam_from_world, std::nullopt, std::nullopt});
    if (only < 0 || static_cast<size_t>(only) == c) any |= change(&changed.cameras.back().camera);
  }
  return any ? std::optional(changed) : std::nullopt;
}

void AddDistortion(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  const auto pinhole = [](Camera* camera) {
    if (camera->model == geometry::LensModel::kPinhole) return false;
    *camera = geometry::PinholeOf(*camera);
    return true;
  };
  const auto changed = WithLens(rig, pinhole, -1);
  if (!changed) return;
  list->push_back({Cause::kDistortion, "without distortion",
                   "option 'ignore-distortion', or the calibration of the undistorted images", *changed, frames});
}

void AddTermOrders(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  std::set<std::string> names;
  for (const auto& camera : rig.cameras) {
    for (const geometry::TermOrder& order : geometry::OtherTermOrders(camera.camera)) names.insert(order.name);
  }
  for (const std::string& name : names) {
    const auto reorder = [&name](Camera* camera) {
      for (const geometry::TermOrder& order : geometry::OtherTermOrders(*camera)) {
        if (order.name != name) continue;
        *camera = order.camera;
        return true;
      }
      return false;
    };
    const auto changed = WithLens(rig, reorder, -1);
    if (!changed) continue;
    list->push_back({Cause::kTermOrder, "with the distortion read as " + name,
                     "write the file anew with its terms in the order of its format", *changed, frames});
  }
}

/// Another size of the images than the calibrated one.
struct Resize {
  std::string text;
  ChangeLens change;
  double scale = 0;  ///< of both sides; 0: another change
};

/// One side is `from` px in the calibration and `to` in the images: scaled along it, or cropped before it or on both sides.
/// (Cropped behind it nothing changes.)
void AddSide(int from, int to, bool is_height, std::vector<Resize>* list) {
  const Eigen::Index focal = is_height ? 1 : 0, center = is_height ? 3 : 2;
  const auto concerns = [=](const Camera& camera) { return (is_height ? camera.height_px : camera.width_px) == from; };
  const std::string size = std::to_string(to) + " px " + (is_height ? "high" : "wide");
  list->push_back({"scaled to " + size, [=](Camera* camera) {
                     if (!concerns(*camera)) return false;
                     const double scale = static_cast<double>(to) / from;
                     camera->params[focal] *= scale;
                     camera->params[center] = (camera->params[center] + 0.5) * scale - 0.5;
                     return true;
                   }});
  for (const double share : {1.0, 0.5}) {
    const std::string where = share < 1 ? " on both sides" : is_height ? " at the top" : " on the left";
    list->push_back({(to < from ? "cropped to " : "padded to ") + size + where, [=](Camera* camera) {
                       if (!concerns(*camera)) return false;
                       camera->params[center] += share * (to - from);
                       return true;
                     }});
  }
}

std::vector<Resize> Resizes() {
  std::vector<Resize> list;
  for (const bool is_height : {true, false}) {
    AddSide(1088, 1080, is_height, &list), AddSide(1080, 1088, is_height, &list);
  }
  const std::pair<double, const char*> scales[] = {{0.5, "half"},
                                                   {2, "twice"},
                                                   {2.0 / 3, "two thirds of"},
                                                   {1.5, "1.5 times"},
                                                   {1.0 / 3, "a third of"},
                                                   {3, "three times"},
                                                   {0.25, "a fourth of"},
                                                   {4, "four times"},
                                                   {0.75, "three fourths of"},
                                                   {4.0 / 3, "4/3 times"}};
  for (const auto& [scale, words] : scales) {
    list.push_back({std::string(words) + " the calibrated size",
                    [scale = scale](Camera* camera) {
                      camera->params.head<2>() *= scale;
                      camera->params.segment<2>(2) = (camera->params.segment<2>(2).array() + 0.5) * scale - 0.5;
                      return true;
                    },
                    scale});
  }
  return list;
}

/// option 'image-size' for one camera, or all with -1.
std::string SizeRemedy(const Rig& rig, double scale, int only) {
  const auto size = [&](const Camera& camera) {
    return std::to_string(std::lround(scale * camera.width_px)) + "x" + std::to_string(std::lround(scale * camera.height_px));
  };
  if (only >= 0) {
    const Camera& camera = rig.cameras[static_cast<size_t>(only)].camera;
    return "option 'image-size' " + ShellWord(camera.name + "=" + size(camera));
  }
  const std::string first = size(rig.cameras.front().camera);
  const bool alike =
      std::all_of(rig.cameras.begin(), rig.cameras.end(), [&](const auto& camera) { return size(camera.camera) == first; });
  if (alike) return "option 'image-size' " + first;
  return Join(rig.cameras, " ",
              [&](const auto& c) { return "option 'image-size' " + ShellWord(c.camera.name + "=" + size(c.camera)); });
}

void AddImageSizes(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  const int num_cameras = static_cast<int>(rig.cameras.size());
  for (const Resize& resize : Resizes()) {
    for (int only = -1; only < num_cameras; ++only) {
      const auto changed = WithLens(rig, resize.change, only);
      if (!changed) continue;
      const std::string whose = only < 0 ? "the images" : "the images of " + rig.cameras[static_cast<size_t>(only)].camera.name;
      const std::string remedy =
          resize.scale > 0
              ? SizeRemedy(rig, resize.scale, only)
              : "detect in images of the calibrated size, or bring the calibration to theirs with mvstudio calib resize";
      list->push_back({Cause::kImageSize, "with " + whose + " " + resize.text, remedy, *changed, frames});
    }
  }
}

void AddExchanges(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  for (size_t a = 0; a < rig.cameras.size(); ++a) {
    for (size_t b = a + 1; b < rig.cameras.size(); ++b) {
      const std::string &first = rig.cameras[a].camera.name, &second = rig.cameras[b].camera.name;
      Assumption& other =
          list->emplace_back(Assumption{Cause::kExchanged, "with the detections of " + first + " and " + second + " exchanged",
                                        "option 'swap-cameras' " + ShellWord(first + "," + second), rig, frames});
      for (DetectedFrame& frame : other.frames) std::swap(frame.people[a], frame.people[b]);
    }
  }
}

void AddPoses(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  const char* const inverted = "with the calibration's poses inverted";
  list->push_back({Cause::kInverted, inverted, "option 'invert'", geometry::WithPosesInverted(rig), frames});
  list->push_back(
      {Cause::kInverted, inverted, "option 'invert'", geometry::WithAxesRotated(geometry::WithPosesInverted(rig)), frames});
  list->push_back({Cause::kMirroredPoses, "with the calibration's poses mirrored", "option 'mirror'",
                   geometry::WithAxesMirrored(rig), frames});
}

/// Each camera in turn left out, where the others can still contradict each other.
void AddLeftOut(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  if (rig.cameras.size() < 4) return;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::string& name = rig.cameras[c].camera.name;
    Assumption& other =
        list->emplace_back(Assumption{Cause::kMoved, "without " + name + ", which has moved or has another calibration",
                                      "option 'without-camera' " + ShellWord(name) + ", or calibrate it again", rig, frames});
    for (DetectedFrame& frame : other.frames) frame.people[c].clear();
  }
}

}  // namespace

std::vector<Assumption> Assumptions(const Rig& rig, const std::vector<DetectedFrame>& frames, const MirrorGroups& mirror,
                                    bool alike) {
  std::vector<Assumption> list;
  AddDetectedChanges(rig, frames, mirror, alike, &list);
  AddPoses(rig, frames, &list);
  if (alike) {
    AddLeftOut(rig, frames, &list);
    return list;
  }
  AddImageSizes(rig, frames, &list);
  AddDistortion(rig, frames, &list);
  AddTermOrders(rig, frames, &list);
  AddExchanges(rig, frames, &list);
  AddLeftOut(rig, frames, &list);
  return list;
}

std::vector<Clock> ClocksAskedFor(const Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                                  bool find_rates, const RunContext& run) {
  const size_t count = std::min(frames.size(), kMostClockFrames), left = frames.size() - count;
  const auto found_in = [&](size_t first, bool rates) {
    SyncOptions sync;
    sync.min_score = options.min_score, sync.max_offset_frames = options.max_offset_frames, sync.find_rates = rates;
    RunContext silent = run;
    silent.progress = nullptr;
    const auto begin = frames.begin() + static_cast<std::ptrdiff_t>(first);
    return SynchronizeCameras(Prepare(rig), std::vector<DetectedFrame>(begin, begin + static_cast<std::ptrdiff_t>(count)), sync,
                              silent);
  };
  SyncResult found = found_in(left / 2, false);
  if (found.status != SyncStatus::kOk && find_rates) found = found_in(0, true);  // clocks of other rates part with time
  std::vector<Clock> clocks;
  bool any = false;
  for (const CameraSync& camera : found.cameras) {
    constexpr double kLeastFrames = 0.1, kLeastSigmas = 5;
    const double least = std::max(kLeastFrames, kLeastSigmas * camera.sigma_frames);
    Clock clock = camera.status == SyncStatus::kOk ? camera.clock() : Clock();
    if (clock.rate == 1 && std::abs(clock.offset_frames) < least) clock.offset_frames = 0;
    any |= clock.rate != 1 || clock.offset_frames != 0;
    clocks.push_back(clock);
  }
  return any ? clocks : std::vector<Clock>();
}

Assumption WithClocks(const Rig& rig, const std::vector<Clock>& clocks) {
  constexpr double kDrift = 0.01, kStart = 0.5, kHz = 60;
  Assumption other{Cause::kTimeOffset, "", "run `mvstudio sync` and give its result with option 'sync'", rig, {}};
  std::string rates = Format("option 'rate' %g", kHz);
  bool start_together = true, nominal = true;
  for (size_t c = 0; c < clocks.size(); ++c) {
    const Clock& clock = clocks[c];
    const std::string& name = rig.cameras[c].camera.name;
    start_together &= std::abs(clock.offset_frames) < kStart * std::max(1.0, clock.rate);
    if (clock.offset_frames == 0 && clock.rate == 1) continue;
    other.text += (other.text.empty() ? "with " : ", ") + name;
    if (std::abs(clock.rate - 1) > kDrift) {
      other.cause = Cause::kRates;
      const double hz = std::round(kHz * clock.rate);
      nominal &= std::abs(hz / kHz / clock.rate - 1) < 1e-3;
      other.text += Format(" at %.4g frames for one of the others", clock.rate);
      rates += " option 'rate' " + ShellWord(name + Format("=%g", hz));
    } else if (clock.rate != 1) {
      other.text += Format(" drifting by %+.0f ppm", 1e6 * (clock.rate - 1));
    }
    if (std::abs(clock.offset_frames) < 0.05) continue;
    other.text += Format(" %.1f frames %s", std::abs(clock.offset_frames), clock.offset_frames > 0 ? "later" : "earlier");
  }
  if (other.cause == Cause::kRates && start_together && nominal) other.remedy = rates + " (only the ratios count)";
  return other;
}

}  // namespace mvstudio::triangulate::internal
