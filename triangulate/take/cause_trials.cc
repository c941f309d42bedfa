#include "triangulate/take/cause_trials.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "core/format.h"
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
                   "if the images are undistorted already, give the calibration of the undistorted ones (triangulate: "
                   "option 'ignore-distortion')",
                   *changed, frames});
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

/// Another size of the pictures than the calibrated one.
struct Resize {
  std::string text;
  ChangeLens change;
};

/// One side is `from` px in the calibration and `to` in the pictures: scaled along it, or cropped before it or on both sides.
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
  const std::pair<double, const char*> scales[] = {
      {0.5, "half"},           {2, "twice"},         {2.0 / 3, "two thirds of"}, {1.5, "1.5 times"},
      {1.0 / 3, "a third of"}, {0.25, "a fourth of"}};
  for (const auto& [scale, words] : scales) {
    list.push_back({std::string(words) + " the calibrated size", [scale = scale](Camera* camera) {
                      camera->params.head<2>() *= scale;
                      camera->params.segment<2>(2) = (camera->params.segment<2>(2).array() + 0.5) * scale - 0.5;
                      return true;
                    }});
  }
  return list;
}

void AddImageSizes(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  const int num_cameras = static_cast<int>(rig.cameras.size());
  for (const Resize& resize : Resizes()) {
    for (int only = -1; only < num_cameras; ++only) {
      const auto changed = WithLens(rig, resize.change, only);
      if (!changed) continue;
      const std::string whose = only < 0 ? "the images" : "the images of " + rig.cameras[static_cast<size_t>(only)].camera.name;
      list->push_back({Cause::kImageSize, "with " + whose + " " + resize.text,
                       "detect in images of the calibrated size, or bring the calibration to theirs with mvstudio calib resize",
                       *changed, frames});
    }
  }
}

void AddExchanges(const Rig& rig, const std::vector<DetectedFrame>& frames, std::vector<Assumption>* list) {
  for (size_t a = 0; a < rig.cameras.size(); ++a) {
    for (size_t b = a + 1; b < rig.cameras.size(); ++b) {
      const std::string &first = rig.cameras[a].camera.name, &second = rig.cameras[b].camera.name;
      Assumption& other = list->emplace_back(
          Assumption{Cause::kExchanged, "with the detections of " + first + " and " + second + " exchanged",
                     "give each camera its own footage: " + first + " and " + second + " bear each other's name", rig, frames});
      for (DetectedFrame& frame : other.frames) std::swap(frame.people[a], frame.people[b]);
    }
  }
}

void FlipPerson(const Camera& camera, bool across, bool down, const MirrorGroups& mirror, DetectedPerson* person) {
  for (Keypoint& key : *person) {
    if (across) key.px.x() = camera.width_px - 1 - key.px.x();
    if (down) key.px.y() = camera.height_px - 1 - key.px.y();
  }
  for (const auto& group : mirror) {
    for (const auto& [left, right] : group) {
      std::swap((*person)[static_cast<size_t>(left)], (*person)[static_cast<size_t>(right)]);
    }
  }
}

/// A picture that is mirrored shows the left hand as a right one; a detector calls it so, markers keep their names.
void AddFlips(const Rig& rig, const std::vector<DetectedFrame>& frames, const MirrorGroups& mirror,
              std::vector<Assumption>* list) {
  struct Flip {
    const char* text;
    bool across, down, sides;
  };
  const Flip flips[] = {{"mirrored", true, false, false},
                        {"mirrored", true, false, true},
                        {"mirrored upside down", false, true, false},
                        {"turned by 180 degrees", true, true, false}};
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    for (const Flip& flip : flips) {
      if (flip.sides && mirror.empty()) continue;
      const Camera& camera = rig.cameras[c].camera;
      Assumption& other = list->emplace_back(
          Assumption{Cause::kMirrored, "with the images of " + camera.name + " " + flip.text,
                     "the images of " + camera.name + " are flipped against the calibration's: flip them back and detect again",
                     rig, frames});
      for (DetectedFrame& frame : other.frames) {
        for (DetectedPerson& person : frame.people[c]) {
          FlipPerson(camera, flip.across, flip.down, flip.sides ? mirror : MirrorGroups(), &person);
        }
      }
    }
  }
}

}  // namespace

std::vector<Assumption> Assumptions(const Rig& rig, const std::vector<DetectedFrame>& frames, const MirrorGroups& mirror) {
  std::vector<Assumption> list;
  AddDistortion(rig, frames, &list);
  AddTermOrders(rig, frames, &list);
  AddImageSizes(rig, frames, &list);
  AddExchanges(rig, frames, &list);
  AddFlips(rig, frames, mirror, &list);
  return list;
}

std::vector<double> OffsetsAskedFor(const Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                                    const RunContext& run) {
  constexpr size_t kMaxFrames = 600;
  const size_t count = std::min(frames.size(), kMaxFrames);
  const auto begin = frames.begin() + static_cast<std::ptrdiff_t>((frames.size() - count) / 2);
  SyncOptions sync;
  sync.min_score = options.min_score;
  sync.max_offset_frames = options.max_offset_frames;
  RunContext silent = run;
  silent.progress = nullptr;
  const SyncResult found = SynchronizeCameras(
      Prepare(rig), std::vector<DetectedFrame>(begin, begin + static_cast<std::ptrdiff_t>(count)), sync, silent);
  std::vector<double> offsets;
  bool any = false;
  for (const CameraSync& camera : found.cameras) {
    constexpr double kLeastFrames = 0.1, kLeastSigmas = 5;
    const double least = std::max(kLeastFrames, kLeastSigmas * camera.sigma_frames);
    const bool asked = camera.status == SyncStatus::kOk && std::abs(camera.offset_frames) >= least;
    offsets.push_back(asked ? camera.offset_frames : 0);
    any |= asked;
  }
  return any ? offsets : std::vector<double>();
}

std::string OffsetText(const Rig& rig, const std::vector<double>& offset_frames) {
  std::string text;
  for (size_t c = 0; c < offset_frames.size(); ++c) {
    if (offset_frames[c] == 0) continue;
    const std::string shift = Format(" %.1f frames %s", std::abs(offset_frames[c]), offset_frames[c] > 0 ? "later" : "earlier");
    text += (text.empty() ? "with " : ", ") + rig.cameras[c].camera.name + shift;
  }
  return text;
}

}  // namespace mvstudio::triangulate::internal
