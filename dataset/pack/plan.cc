#include "dataset/pack/plan.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "core/check.h"
#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "dataset/json/json_file.h"
#include "dataset/pack/shard.h"
#include "dataset/panoptic/in_view.h"
#include "dataset/views/person_extents.h"
#include "dataset/views/split.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kShardPixelBytes = int64_t{768} << 20;  // decoded images of one shard, at most

void CheckOptions(const PackOptions& o) {
  if (o.crop_px < 8 || o.crop_px > 4096) throw UsageError("option 'crop' " + std::to_string(o.crop_px) + ": use 8 to 4096 px");
  if (!(o.fill > 0.05 && o.fill <= 2)) throw UsageError("option 'fill': use 0.05 to 2");
  if (!(o.half_extent_m >= 0 && o.half_extent_m < 100))
    throw UsageError("option 'half-extent': use metres, or 0 for the person's own");
  if (o.shard_samples < 1) throw UsageError("option 'shard-samples': use 1 or more");
  if (o.undistort && !o.full) throw UsageError("option 'undistort' goes with option 'full'; crops are undistorted always");
}

std::set<int> ChooseCameras(const PanopticDataset& dataset, const std::vector<std::string>& names) {
  std::set<int> chosen;
  for (const std::string& name : names) {
    const int idx = dataset.rig.Find(dataset.Resolve(name));
    if (idx < 0) throw UsageError("option 'cameras': '" + name + "' is not in " + dataset.root);
    chosen.insert(idx);
  }
  for (size_t i = 0; names.empty() && i < dataset.rig.cameras.size(); ++i) chosen.insert(static_cast<int>(i));
  return chosen;
}

std::set<int> ChooseFrames(PackPlan* plan) {
  const std::vector<int>& known = plan->dataset.frames;
  FrameChoice choice = KnownFrames("option 'frames'", plan->options.frames, known, plan->dataset.root);
  plan->frames_beyond = std::move(choice.beyond);
  const std::vector<int>& chosen = plan->options.frames.empty() ? known : choice.frames;
  return {chosen.begin(), chosen.end()};
}

void RequirePerson(const PanopticDataset& dataset, int person) {
  for (const auto& [frame, people] : dataset.poses) {
    if (people.count(person)) return;
  }
  throw UsageError("option 'person' " + std::to_string(person) + " is in no frame of " + dataset.root);
}

std::vector<PackTarget> TargetsOf(const PackPlan& plan, int camera_idx, int frame) {
  std::vector<PackTarget> targets;
  const auto& people = plan.dataset.poses.at(frame);
  if (plan.view != PackView::kCrop) {
    targets.push_back({people.count(plan.options.person) ? plan.options.person : -1, {}});
    return targets;
  }
  for (const auto& [id, pose] : people) {
    if (plan.options.person >= 0 && id != plan.options.person) continue;
    const auto extent = MeasurePerson(pose, plan.dataset.rig.cameras[camera_idx]);
    if (extent) targets.push_back({id, *extent});
  }
  return targets;
}

int64_t BytesOfImage(const PackPlan& plan) {
  int64_t largest = 3 * int64_t{plan.options.crop_px} * plan.options.crop_px;
  for (const geometry::RigCamera& c : plan.views) {
    largest = std::max(largest, 3 * int64_t{c.camera.width_px} * c.camera.height_px);
  }
  return largest;
}

void FillShards(const std::optional<Split>& split, PackPlan* plan) {
  const std::set<int> cameras = ChooseCameras(plan->dataset, plan->options.cameras);
  const int64_t limit = std::clamp<int64_t>(kShardPixelBytes / BytesOfImage(*plan), 1, plan->options.shard_samples);
  int64_t held = 0;
  for (const int frame : ChooseFrames(plan)) {
    std::vector<PackImage> images;
    int64_t count = 0;
    for (const int c : cameras) {
      const PartOfSplit part = split ? PartOf(*split, plan->dataset.rig.cameras[c].camera.name, frame) : PartOfSplit::kNone;
      if (split && part == PartOfSplit::kNone) continue;
      PackImage image{c, frame, part, TargetsOf(*plan, c, frame)};
      count += static_cast<int64_t>(image.targets.size());
      if (!image.targets.empty()) images.push_back(std::move(image));
    }
    const auto& people = plan->dataset.poses.at(frame);
    plan->frames_without_person += plan->options.person < 0 ? people.empty() : people.count(plan->options.person) == 0;
    if (images.empty()) continue;
    if (plan->shards.empty() || held + count > limit) plan->shards.emplace_back(), held = 0;
    held += count;
    for (PackImage& image : images) plan->shards.back().push_back(std::move(image));
  }
  if (plan->shards.empty())
    throw UsageError("nothing to pack: no camera sees a person in the chosen frames of " + plan->dataset.root);
}

/// What the dataset does not hold of the planned images. A camera without any is refused.
void FindMissingOfPlan(PackPlan* plan) {
  std::map<int, std::vector<int>> frames;
  for (const auto& shard : plan->shards) {
    for (const PackImage& image : shard) frames[image.camera_idx].push_back(image.frame);
  }
  for (const auto& [camera_idx, of_camera] : frames) {
    const std::string& name = plan->dataset.rig.cameras[camera_idx].camera.name;
    plan->missing.by_camera.merge(FindMissing(plan->dataset, {name}, of_camera, plan->masks).by_camera);
    const MissingOfCamera& missing = plan->missing.by_camera.at(name);
    if (missing.no_image.size() == of_camera.size()) {
      throw FormatError(plan->dataset.root, "hdImgs/" + name,
                        "holds none of the " + std::to_string(of_camera.size()) +
                            " pictures to pack; leave the camera out with option 'cameras'");
    }
  }
}

void FillViews(PackPlan* plan) {
  if (plan->view == PackView::kCrop) return;
  for (const geometry::RigCamera& camera : plan->dataset.rig.cameras) {
    if (plan->view == PackView::kFull) {
      plan->views.push_back(camera);
      continue;
    }
    const UndistortedCamera pinhole = IdealPinhole(camera, plan->options.undistort_view);
    if (!pinhole.usable()) throw UsageError("camera " + camera.camera.name + " cannot be undistorted: " + pinhole.reason);
    plan->views.push_back(pinhole.camera);
  }
}

// Digest of the 3D joints as they were read.
std::string PosesSha256(const std::map<int, std::string>& paths) {
  Sha256 digest;
  for (const auto& [frame, path] : paths) {
    const std::string line = std::to_string(frame) + " " + Sha256File(path) + "\n";
    digest.Update(line.data(), line.size());
  }
  return digest.HexDigest();
}

// Digest of what is in each shard; the files themselves are in the done-markers.
std::string ImagesSha256(const PackPlan& plan) {
  Sha256 list;
  for (const auto& shard : plan.shards) {
    std::string text = "shard\n";
    for (const PackImage& p : shard) {
      text += std::to_string(p.camera_idx) + " " + std::to_string(p.frame) + " " + std::to_string(static_cast<int>(p.part));
      for (const PackTarget& t : p.targets) text += " " + std::to_string(t.person);
      text += "\n";
    }
    list.Update(text.data(), text.size());
  }
  return list.HexDigest();
}

void AddView(const PackPlan& plan, Json* json) {
  (*json)["view"] = ToString(plan.view);
  if (plan.view == PackView::kCrop) {
    (*json)["crop_px"] = plan.options.crop_px;
    (*json)["fill"] = plan.options.fill;
    (*json)["half_extent_m"] = Json::object();
    for (const auto& [id, extent] : plan.half_extent_m) (*json)["half_extent_m"][std::to_string(id)] = extent;
  }
  if (plan.view == PackView::kUndistorted) {
    VisitConstFields(
        [&](const std::string& name, const auto& value, const std::string&) {
          if constexpr (kHasWords<std::decay_t<decltype(value)>>) {
            (*json)["undistort"][name] = ToString(value);
          } else {
            (*json)["undistort"][name] = value;
          }
        },
        plan.options.undistort_view);
  }
}

std::string PlanJson(const PackPlan& plan, const std::optional<Split>& split) {
  const std::string calibration = FindPanopticCalibration(plan.dataset.root);
  Json json = {{"schema", "mvstudio.pack-plan/1"}, {"sequence", plan.dataset.sequence}};
  AddView(plan, &json);
  json["codec"] = ToString(plan.options.codec);
  json["mask_codec"] = plan.masks ? "png" : "none";
  const MaskMeaning masks = plan.masks ? plan.dataset.Masks() : MaskMeaning{};
  if (masks.from_alpha) json["masks_in"] = "opacity";
  if (masks.form == MaskMeaning::Form::kLabels) json["mask_values"] = "labels";
  json["person"] = plan.options.person;
  const std::vector<std::string> names = geometry::CameraNames(plan.dataset.rig);
  json["aliases"] = plan.dataset.aliases;
  json["colour"] = plan.options.match_colours ? Json::parse(ColourMatchToJsonText(plan.colour, names)) : Json();
  json["split"] = split ? Json::parse(SplitToJsonText(*split)) : Json();
  json["inputs"]["calibration"] = {{"file", fs::path(calibration).filename().string()}, {"sha256", Sha256File(calibration)}};
  json["inputs"]["joints_sha256"] = PosesSha256(plan.scene_paths);
  json["shards"] = plan.shards.size();
  json["pictures_sha256"] = ImagesSha256(plan);
  return json.dump(1);
}

void CheckImageSizes(const PanopticDataset& dataset) {
  for (const auto& camera : dataset.rig.cameras) {
    if (int64_t{camera.camera.width_px} * camera.camera.height_px > kMaxImagePx) {
      throw UsageError("camera " + camera.camera.name + " has images too large for a pack");
    }
  }
}

void ChoosePerson(PackPlan* plan) {
  PackOptions& options = plan->options;
  if (options.person >= 0) RequirePerson(plan->dataset, options.person);
  // The person whose joints go with whole images.
  if (options.full && options.person < 0) options.person = MostSeenPerson(plan->dataset);
  if (plan->view != PackView::kCrop) return;
  plan->half_extent_m = LargeExtents(plan->dataset);
  if (options.half_extent_m <= 0) return;
  for (auto& [id, extent] : plan->half_extent_m) extent = options.half_extent_m;
}

std::optional<Split> ReadSplitFor(const PackPlan& plan) {
  const std::string& path = plan.options.split;
  if (path.empty()) return std::nullopt;
  Split split = ReadSplit(path);
  RequireSplitOf(split, plan.dataset, path);
  return split;
}

}  // namespace

std::string ToString(PackView view) {
  return view == PackView::kCrop ? "crop" : view == PackView::kFull ? "full" : "undistorted";
}

PackPlan MakePackPlan(const std::string& dataset_root, const PackOptions& options, const RunContext& run) {
  CheckOptions(options);
  PackPlan plan;
  plan.options = options;
  plan.view = !options.full ? PackView::kCrop : options.undistort ? PackView::kUndistorted : PackView::kFull;
  plan.dataset = OpenPanopticDataset(dataset_root);
  RequireInView(plan.dataset, true);
  plan.scene_paths = ListBody3dScenes(dataset_root);
  plan.masks = options.masks && fs::is_directory(dataset_root + "/masks");
  CheckImageSizes(plan.dataset);
  ChoosePerson(&plan);
  const std::optional<Split> split = ReadSplitFor(plan);
  FillViews(&plan);
  FillShards(split, &plan);
  FindMissingOfPlan(&plan);
  if (options.match_colours) plan.colour = MatchDatasetColours(plan.dataset, options.colour, run);
  plan.rig_json = geometry::RigToJsonText(plan.dataset.rig);
  plan.json = PlanJson(plan, split);
  plan.sha256 = Sha256Hex(plan.json.data(), plan.json.size());
  return plan;
}

}  // namespace mvstudio::dataset::internal
