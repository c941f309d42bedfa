#include "dataset/build/build.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "dataset/build/build_blocks.h"
#include "dataset/build/build_camera.h"
#include "dataset/build/footage_check.h"
#include "dataset/build/read_joints.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/markers.h"
#include "dataset/session/session.h"
#include "geometry/rig/plausible.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using internal::CameraJob;
using internal::CameraResult;
using internal::Json;
using internal::People;

constexpr char kDatasetSchema[] = "mvstudio.dataset/1";

/// Names stay when all are Panoptic's already; otherwise cameras are numbered in the calibration's order.
std::string PanopticName(const geometry::Rig& rig, int idx) {
  int panel = 0, node = 0;
  const bool all = std::all_of(rig.cameras.begin(), rig.cameras.end(),
                               [&](const auto& c) { return ParsePanopticName(c.camera.name, &panel, &node); });
  if (all) return rig.cameras[idx].camera.name;
  if (idx > 99) throw UsageError("Panoptic names hold 100 cameras (00_00 to 00_99); the calibration has more");
  return Format("00_%02d", idx);
}

void CheckOptions(const BuildInputs& inputs, const BuildOptions& options) {
  const std::string why = WhyNotAName(options.sequence);
  if (!why.empty()) throw UsageError("option 'sequence' must be a plain name: it " + why);
  if (options.jpeg_quality < 0 || options.jpeg_quality > 100) throw UsageError("option 'jpeg-quality' must be in 0..100");
  if (!IsFrameRate(options.frame_rate_hz)) throw UsageError(std::string("option 'frame-rate' ") + kFrameRates);
  if (inputs.footage.empty())
    throw UsageError("no footage was given: add option 'video' CAMERA=FILE or option 'images' CAMERA=PATTERN");
  std::set<std::string> cameras;
  for (const CameraFootage& f : inputs.footage) {
    if (!cameras.insert(f.camera).second) throw UsageError("camera " + f.camera + " was given footage twice");
  }
}

double MedianRms(const Pose3d& pose) {
  std::vector<double> rms_px;
  for (const JointRow& row : pose.rows) {
    if (row.status == Status::kOk) rms_px.push_back(row.rms_px);
  }
  return UpperMedian(std::move(rms_px), 0);
}

std::vector<CameraJob> MakeJobs(const BuildInputs& inputs, const geometry::Rig& rig, const std::map<int, People>& poses,
                                double joint_rms_px, const std::string& folder,
                                const std::map<std::string, internal::GivenMasks>& masks) {
  std::vector<CameraJob> jobs;
  for (const CameraFootage& footage : inputs.footage) {
    const int idx = rig.Find(footage.camera);
    if (idx < 0) {
      throw FormatError(inputs.calibration, "cameras",
                        "has no camera " + footage.camera + " (footage " + footage.path + "); it has " +
                            Join(geometry::CameraNames(rig), ", "));
    }
    CameraJob job;
    job.footage = footage;
    job.name = PanopticName(rig, idx);
    job.camera = rig.cameras[idx];
    job.poses = &poses;
    job.joint_rms_px = joint_rms_px;
    const auto given = masks.find(footage.camera);
    job.masks = given == masks.end() ? nullptr : &given->second;
    job.folder = folder;
    jobs.push_back(job);
  }
  std::sort(jobs.begin(), jobs.end(), [](const CameraJob& a, const CameraJob& b) { return a.name < b.name; });
  return jobs;
}

double TakeFrameRate(const std::vector<CameraResult>& results, const BuildOptions& options, std::vector<Notice>* warnings) {
  double rate = 0;
  for (const CameraResult& r : results) {
    if (r.frame_rate_hz <= 0) continue;
    if (rate > 0 && std::abs(r.frame_rate_hz - rate) > 0.01 * rate) {
      warnings->push_back({"DAT-RATE",
                           "camera " + r.built.alias + " runs at " + internal::NumberText(r.frame_rate_hz) +
                               " frames a second, others at " + internal::NumberText(rate),
                           "frames are matched by number: bring the videos to one rate first"});
    }
    if (rate <= 0) rate = r.frame_rate_hz;
  }
  return rate > 0 ? rate : options.frame_rate_hz;
}

Json FileEntry(const std::string& path) {
  Json entry = {{"path", path}};
  if (fs::is_regular_file(path)) entry["sha256"] = Sha256File(path);
  return entry;
}

Json CameraEntry(const CameraResult& r, const CameraJob& job, bool masks) {
  const geometry::Camera& was = job.camera.camera;
  Json entry = {{"name", r.built.name}, {"alias", r.built.alias}, {"source", FileEntry(job.footage.path)}};
  entry["width"] = r.camera.camera.width_px;
  entry["height"] = r.camera.camera.height_px;
  entry["calibrated_width"] = was.width_px;
  entry["calibrated_height"] = was.height_px;
  const SizeRule& rule = r.size.rule;
  entry["size_rule"] = {{"name", rule.name},
                        {"scale", {rule.scale_x, rule.scale_y}},
                        {"offset_px", {rule.offset_x_px, rule.offset_y_px}},
                        {"decisive", r.size.decisive}};
  entry["images"] = r.built.images;
  if (!r.gaps.empty()) entry["without_picture"] = r.gaps;
  if (!masks) return entry;
  if (job.masks) {
    entry["mask"] = {{"method", "given"}, {"mean_area_fraction", r.built.mean_area_fraction}};
    if (!r.built.without_mask.empty()) entry["without_mask"] = r.built.without_mask;
    return entry;
  }
  entry["mask"] = {{"method", job.footage.plate.empty() ? "background-cut/take" : "background-cut/plate"},
                   {"background_known", r.built.background_known},
                   {"mean_area_fraction", r.built.mean_area_fraction},
                   {"joints", r.built.joints},
                   {"joints_on_mask", r.built.joints_on_mask},
                   {"joints_supported", r.built.joints_supported}};
  return entry;
}

std::string Sidecar(const BuildInputs& inputs, const BuildOptions& options, const std::vector<CameraJob>& jobs,
                    const std::vector<CameraResult>& results, const std::map<int, People>& poses, double frame_rate_hz,
                    const std::string& skeleton) {
  Json json = {{"schema", kDatasetSchema}, {"sequence", options.sequence}, {"frame_rate_hz", frame_rate_hz}};
  if (!skeleton.empty()) json["skeleton"] = skeleton;
  json["calibration"] = FileEntry(inputs.calibration);
  const std::string points = PointsFileAt(inputs.pose3d);
  json["pose3d"] = FileEntry(points.empty() ? inputs.pose3d : points);
  json["pictures"] = options.png ? Json{{"format", "png"}} : Json{{"format", "jpeg"}, {"quality", options.jpeg_quality}};
  json["frames"] = Json::array();
  for (const auto& [frame, people] : poses) json["frames"].push_back(frame);
  json["cameras"] = Json::array();
  for (size_t i = 0; i < results.size(); ++i) json["cameras"].push_back(CameraEntry(results[i], jobs[i], options.masks));
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void WritePoses(const std::map<int, People>& poses, double frame_rate_hz, const std::string& folder) {
  for (const auto& [frame, people] : poses) {
    WriteBody3dScene(people, 1000.0 * frame / frame_rate_hz,
                     folder + "/hdPose3d_stage1_coco19/" + Format("body3DScene_%08d.json", frame));
  }
}

std::vector<CameraResult> RunJobs(std::vector<CameraJob>* jobs, const BuildOptions& options, int num_frames,
                                  const RunContext& run) {
  std::vector<CameraResult> results(jobs->size());
  ProgressStage stage(run, "images and masks", int64_t(num_frames) * int64_t(jobs->size()));
  std::mutex mutex;
  for (CameraJob& job : *jobs) {
    job.on_image = [&stage, &mutex] {
      const std::lock_guard<std::mutex> lock(mutex);
      stage.Advance();
    };
  }
  ParallelFor(static_cast<int64_t>(jobs->size()), run.num_threads,
              [&](int64_t i) { results[i] = BuildCamera((*jobs)[i], options); });
  return results;
}

void AddGaps(const CameraResult& r, BuildReport* report) {
  if (r.gaps.empty()) return;
  report->gaps.push_back({r.built.alias, r.gaps});
  std::string text = "camera " + r.built.alias + " has no image of " + std::to_string(r.gaps.size()) + " of " +
                     std::to_string(report->frames) + " time steps: " + std::to_string(r.gaps.front());
  for (size_t i = 1; i < std::min<size_t>(r.gaps.size(), 8); ++i) text += ", " + std::to_string(r.gaps[i]);
  report->warnings.push_back({"DAT-INSTANTS", text + (r.gaps.size() > 8 ? ", …" : ""),
                              "the camera dropped frames, or they are damaged; see the timeline"});
}

/// Counts the masks that were taken, and names the time steps that have none.
void AddGivenMasks(const BuiltCamera& c, const std::string& folder, BuildReport* report) {
  const std::vector<int>& without = c.without_mask;
  report->given_masks += c.images - static_cast<int>(without.size());
  if (without.empty()) return;
  std::string text = "camera " + c.alias + ": " + folder + " has no mask of " + std::to_string(without.size()) + " of " +
                     std::to_string(c.images) + " images: " + std::to_string(without.front());
  for (size_t i = 1; i < std::min<size_t>(without.size(), 8); ++i) text += ", " + std::to_string(without[i]);
  report->warnings.push_back(
      {"DAT-MASK-MISSING", text + (without.size() > 8 ? ", …" : ""), "these images have no mask in the dataset"});
}

/// Two joints of Panoptic's 19 in some frame.
bool HasLimbs(const std::map<int, People>& poses) {
  for (const auto& [frame, people] : poses) {
    for (const auto& [id, pose] : people) {
      if (std::count(pose.valid.begin(), pose.valid.end(), true) >= 2) return true;
    }
  }
  return false;
}

std::vector<std::string> InputsOf(const BuildInputs& inputs) {
  std::vector<std::string> paths = {inputs.calibration, inputs.pose3d};
  for (const CameraFootage& footage : inputs.footage) paths.insert(paths.end(), {footage.path, footage.plate});
  return paths;
}

/// Images are used whole: an offset of half a frame or more shows another time step.
void NoteOffsets(const BuildInputs& inputs, const geometry::Rig& rig, BuildReport* report) {
  double& largest = report->calibration_offset_frames;
  for (const CameraFootage& footage : inputs.footage) {
    const int c = footage.timeline ? -1 : rig.Find(footage.camera);
    if (c < 0 || !rig.cameras[static_cast<size_t>(c)].time_offset) continue;
    largest = std::max(largest, std::abs(rig.cameras[static_cast<size_t>(c)].time_offset->frames));
  }
  if (largest < 0.5) return;
  const std::string text = Format(
      "the calibration states time offsets of up to %.2f frames, which a dataset of whole images does not apply", largest);
  report->warnings.push_back(
      {"DAT-OFFSETS", text, "run mvstudio sync and session timeline: then each time step has the nearest frame"});
}

bool SeesAny(const geometry::RigCamera& camera, const Pose3d& pose) {
  const geometry::Projector projector(camera.camera);
  return std::any_of(pose.rows.begin(), pose.rows.end(), [&](const JointRow& row) {
    if (row.status != Status::kOk) return false;
    const auto at = projector.Project(camera.cam_from_world * row.x_in_world);
    return at.status == Status::kOk && InImage(camera.camera, at.px);
  });
}

/// Joints of another world than the calibration's are in nobody's view.
void CheckViews(const BuildInputs& inputs, const std::vector<CameraJob>& jobs, const Pose3d& pose, BuildReport* report) {
  std::vector<std::string> blind;
  for (const CameraJob& job : jobs) {
    if (!SeesAny(job.camera, pose)) blind.push_back(job.footage.camera);
  }
  if (blind.empty()) return;
  const std::string why = "was it made with another calibration, or was the rig moved to another world since?";
  std::string conflict;
  for (const Notice& warning : report->warnings) {
    if (warning.code == "DAT-UNIT") conflict = "; DAT-UNIT: " + warning.text + ", " + warning.hint;
  }
  if (blind.size() == jobs.size())
    throw FormatError(
        inputs.pose3d, "",
        "no joint lies in the view of any camera of " + inputs.calibration + ": " + why + " triangulate again" + conflict);
  report->warnings.push_back({"DAT-VIEW", "no joint of any frame lies in the view of " + Join(blind, ", "), why});
}

/// The joints of the pose's own skeleton, where the 19 do not hold them all.
std::optional<OwnJoints> OwnJointsOf(const BuildInputs& inputs, const Pose3d& pose, BuildReport* report) {
  report->joints_beside = JointsBeyondCoco19(pose);
  if (report->joints_beside.empty()) return std::nullopt;
  OwnJoints own;
  own.skeleton = SkeletonOf(pose);
  geometry::SkeletonFromJson(SkeletonToJson(own.skeleton), inputs.pose3d, "its skeleton");  // throws for what no file holds
  own.poses = ToJoints(pose, own.skeleton);
  report->skeleton = own.skeleton.name;
  return own;
}

/// Masks are shaped by people's limbs.
BuildOptions WithPossibleMasks(BuildOptions options, const std::optional<OwnJoints>& own, const std::map<int, People>& poses,
                               bool given, BuildReport* report) {
  if (!options.masks || given || !own || own->skeleton.human) return options;
  if (own->skeleton.bones.empty() && HasLimbs(poses)) return options;  // points with people's names
  options.masks = false;
  report->warnings.push_back(
      {"DAT-MASK",
       "masks are shaped by the limbs of people; skeleton " + own->skeleton.name + " has none of them, so no masks were made",
       "option 'masks' off says so; mvstudio mask makes masks by motion or a net"});
  return options;
}

/// What stands beside the images and masks, and what is to be said of them.
void WriteDataset(const BuildInputs& inputs, const BuildOptions& options, const geometry::Rig& rig,
                  const std::vector<CameraJob>& jobs, const std::vector<CameraResult>& results,
                  const std::map<int, People>& poses, const std::optional<OwnJoints>& own,
                  const std::map<std::string, internal::GivenMasks>& given, const RunContext& run, AtomicFolder* folder,
                  BuildReport* report) {
  Append(geometry::ConflictsIn(rig), &report->warnings);
  report->sequence = options.sequence;
  report->frames = static_cast<int>(poses.size());
  geometry::Rig built_rig;
  for (const CameraResult& r : results) {
    built_rig.cameras.push_back(r.camera);
    report->cameras.push_back(r.built);
    report->images += r.built.images;
    report->warnings.insert(report->warnings.end(), r.warnings.begin(), r.warnings.end());
    AddGaps(r, report);
    if (!given.empty()) AddGivenMasks(r.built, inputs.masks, report);
  }
  internal::WarnOfFootage(results, poses, folder->work_path(), options, inputs.masks, run, &report->warnings);
  if (!given.empty()) report->masks = given.begin()->second.meaning;
  if (!given.empty() && report->given_masks == 0)
    throw FormatError(inputs.masks, "",
                      "no mask there has the number of a frame that is built: names must end in frame numbers");
  NoteOffsets(inputs, rig, report);
  const double frame_rate_hz = TakeFrameRate(results, options, &report->warnings);
  WritePanopticCalibration(built_rig, folder->work_path() + "/calibration_" + options.sequence + ".json",
                           "mvstudio, " + fs::path(inputs.calibration).filename().string());
  WritePoses(poses, frame_rate_hz, folder->work_path());
  if (own) WriteOwnJoints(*own, frame_rate_hz, folder->work_path());
  WriteFileAtomic(folder->work_path() + "/dataset.json",
                  Sidecar(inputs, options, jobs, results, poses, frame_rate_hz, report->skeleton));
  folder->Commit();
}

/// What a build stands on.
struct Ground {
  geometry::Rig rig;
  Pose3d pose;
  std::map<int, People> poses;
  std::optional<OwnJoints> own;
  std::map<std::string, internal::GivenMasks> given;
  BuildOptions options;
};

Ground GroundOf(const BuildInputs& inputs, const BuildOptions& wanted, BuildReport* report) {
  CheckOptions(inputs, wanted);
  Ground ground;
  ground.rig = ReadAnyCalibration(inputs.calibration);
  ground.pose = internal::ReadJointsOf(inputs, report);
  report->world = ground.pose.world;
  ground.poses = ToCoco19(ground.pose);
  ground.own = OwnJointsOf(inputs, ground.pose, report);
  if (wanted.masks) ground.given = internal::FindGivenMasks(inputs);
  Append(internal::NumberMasksAsFrames(inputs, &ground.given), &report->warnings);
  ground.options = WithPossibleMasks(wanted, ground.own, ground.poses, !ground.given.empty(), report);
  return ground;
}

}  // namespace

BuildReport BuildDataset(const BuildInputs& inputs, const std::string& out, const BuildOptions& wanted, const RunContext& run) {
  BuildReport report;
  const Ground g = GroundOf(inputs, wanted, &report);
  AtomicFolder folder(out, wanted.overwrite, InputsOf(inputs));
  std::vector<CameraJob> jobs = MakeJobs(inputs, g.rig, g.poses, MedianRms(g.pose), folder.work_path(), g.given);
  internal::RequireSizes(jobs, inputs.calibration, g.options);
  CheckViews(inputs, jobs, g.pose, &report);
  const std::string key = inputs.kept.empty() ? "" : inputs.kept_key();
  for (CameraJob& job : jobs) job.kept = key.empty() ? "" : inputs.kept + "/" + key;
  internal::BlockKeeper keeper(inputs.kept, key);
  keeper.During([&] {
    const std::vector<CameraResult> results = RunJobs(&jobs, g.options, static_cast<int>(g.poses.size()), run);
    WriteDataset(inputs, g.options, g.rig, jobs, results, g.poses, g.own, g.given, run, &folder, &report);
    return true;
  });
  keeper.Forget();
  return report;
}

std::vector<std::string> KeepBuildPart(const BuildInputs& inputs, const BuildPart& part, const BuildOptions& wanted,
                                       const RunContext& run) {
  BuildReport said;  // the build says it again
  const Ground g = GroundOf(inputs, wanted, &said);
  std::vector<CameraJob> jobs = MakeJobs(inputs, g.rig, g.poses, MedianRms(g.pose), "", g.given);
  const auto other = [&](const CameraJob& job) { return job.footage.camera != part.camera; };
  jobs.erase(std::remove_if(jobs.begin(), jobs.end(), other), jobs.end());
  if (jobs.empty()) throw UsageError("camera " + part.camera + " has no footage");
  internal::RequireSizes(jobs, inputs.calibration, g.options);
  const std::string key = inputs.kept_key();
  CameraJob& job = jobs.front();
  job.kept = inputs.kept + "/" + key;
  ProgressStage stage(run, "images and masks", 0);
  job.on_image = [&stage] { stage.Advance(); };
  std::vector<std::string> kept = internal::KeepCameraPart(job, part, g.options);
  for (std::string& name : kept) name = name.substr(inputs.kept.size() + 1);
  return kept;
}

}  // namespace mvstudio::dataset
