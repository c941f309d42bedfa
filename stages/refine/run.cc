#include "stages/refine/run.h"

#include <algorithm>

#include "calib/calibrate.h"
#include "calib/keypoints/moments.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/people/apply_sync.h"
#include "stages/people/known_lengths.h"

namespace mvstudio::stages {
namespace {

std::optional<calib::FrameChoice> ParseFrames(const std::string& option, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const size_t colon = text.find(':');
  const auto number = [&](const std::string& digits) {
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos)
      throw UsageError(option + " " + text + ": give START:STEP, e.g. 0:4 for frames 0, 4, 8, ...");
    return std::stoi(digits);
  };
  calib::FrameChoice choice{number(text.substr(0, colon)), colon == std::string::npos ? 0 : number(text.substr(colon + 1))};
  if (choice.step < 1) throw UsageError(option + " " + text + ": the step must be at least 1 (START:STEP)");
  return choice;
}

/// The rig's cameras that have poses, and the frames with those cameras alone.
struct Posed {
  geometry::Rig rig;
  std::vector<size_t> camera_of;  // index in the whole rig
  std::vector<triangulate::DetectedFrame> frames;
};

Posed PosedCameras(const PoseInput& input) {
  Posed posed;
  for (size_t c = 0; c < input.rig.cameras.size(); ++c) {
    const std::string& name = input.rig.cameras[c].camera.name;
    const auto is_it = [&](const dataset::Pose2dTrack& track) { return track.camera == name; };
    if (std::none_of(input.tracks.begin(), input.tracks.end(), is_it)) continue;
    posed.camera_of.push_back(c);
  }
  posed.rig = geometry::SubsetOf(input.rig, posed.camera_of);
  for (const triangulate::DetectedFrame& frame : input.frames) {
    triangulate::DetectedFrame& own = posed.frames.emplace_back();
    own.frame = frame.frame;
    for (const size_t c : posed.camera_of) own.people.push_back(frame.people[c]);
  }
  return posed;
}

triangulate::CauseOptions CauseOptionsOf(const RefineOptions& options) {
  triangulate::CauseOptions causes;
  causes.min_score = options.adjust.min_score, causes.max_persons = options.adjust.max_persons;
  return causes;
}

/// The causes of a take of which less than half fits the given rig; nothing else is looked at.
std::optional<triangulate::CauseReport> WhyNoFit(const RefineReport& report, const Posed& posed, const RunContext& run) {
  const triangulate::CauseOptions options = CauseOptionsOf(report.options);
  if (FitAsGiven(posed.rig, posed.frames, options, run).carried >= 0.5) return std::nullopt;
  return RankCauses(posed.rig, posed.frames, BodyOf(report.skeleton), options, run);
}

/// What part of a sample of the detections fits the adjusted rig, and what may be wrong.
void CheckFit(const Posed& posed, const RunContext& run, RefineReport* report) {
  const triangulate::CauseOptions options = CauseOptionsOf(report->options);
  report->fit = FitAsGiven(report->refined.rig, posed.frames, options, run);
  if (report->fit.num_detections == 0) return;
  // A camera that is late by a frame bends the rig where its time is not what the others' is.
  report->timing = CheckTiming(report->refined.rig, posed.frames, options, run);
  report->causes = WhyNoFit(*report, posed, run);
}

/// The whole rig with the adjusted cameras in their places; their errors stay correlated.
geometry::Rig Merge(const geometry::Rig& whole, const std::vector<size_t>& camera_of, const geometry::Rig& adjusted) {
  if (camera_of.size() == whole.cameras.size()) return adjusted;
  geometry::Rig merged = whole;
  merged.joint_covariance.reset(), merged.gauge = adjusted.gauge;
  for (size_t i = 0; i < camera_of.size(); ++i) merged.cameras[camera_of[i]] = adjusted.cameras[i];
  const geometry::StatedCovariance from = geometry::StatedCovarianceOf(adjusted);
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(merged);
  for (size_t i = 0; i < camera_of.size(); ++i) {
    for (size_t k = 0; k < camera_of.size(); ++k) {
      const Eigen::Index rows = from.begin[i + 1] - from.begin[i], cols = from.begin[k + 1] - from.begin[k];
      stated.joint.block(stated.begin[camera_of[i]], stated.begin[camera_of[k]], rows, cols) =
          from.joint.block(from.begin[i], from.begin[k], rows, cols);
    }
  }
  stated.correlated = from.correlated;
  geometry::StoreCovariance(stated, &merged);
  return merged;
}

/// Lenses without poses: the cameras with 2D points become a rig by the person alone.
void PlaceCameras(const std::vector<calib::StatedLength>& stated, PoseInput* input, Posed* posed, RefineReport* report) {
  const geometry::Skeleton& skeleton = input->skeleton;
  report->by_height = stated.empty() && skeleton.human && skeleton.lengths.empty();
  report->placed = PlaceFromKeypoints(
      posed->rig, posed->frames,
      stated.empty() ? KnownLengthsOf(skeleton, report->PersonHeightM()) : calib::KnownLengthsOf(stated, skeleton.joints),
      report->options.adjust.min_score);
  if (!report->Placed()) return;
  report->num_not_placed = input->rig.cameras.size() - report->placed->rig.cameras.size();
  posed->rig = input->rig = report->placed->rig;
  for (size_t c = 0; c < posed->camera_of.size(); ++c) posed->camera_of[c] = c;
}

/// The rig that is written, as large as the lengths say. False: what they name was not measured.
bool ScaleWritten(const std::vector<calib::StatedLength>& lengths, const Posed& posed, RefineReport* report) {
  if (lengths.empty()) return true;
  const auto moments = MomentsOf(report->refined.rig, posed.frames, report->skeleton.joints, report->options.adjust);
  report->scale = ScaleFromLengths(lengths, moments);
  if (report->scale->status != Status::kOk) return false;
  report->written = geometry::InWorld(report->written, {}, report->scale->scale);
  report->written.gauge.stated_lengths = true;
  return true;
}

std::vector<std::string> InputsOf(const RefineOptions& options) {
  std::vector<std::string> paths;
  for (const NamedPath& camera : options.pose.pose2d) paths.push_back(camera.path);
  paths.insert(paths.end(), {options.pose.calib, options.pose.points2d, options.sync});
  return paths;
}

}  // namespace

RefineReport RunRefine(RefineOptions given, const RunContext& run) {
  RefineReport report;
  report.options = std::move(given);
  RefineOptions& options = report.options;
  if (options.out.empty()) throw UsageError("option 'out' is required with option 'from-keypoints'");
  const auto train = ParseFrames("option 'train-frames'", options.train_frames);
  const auto test = ParseFrames("option 'test-frames'", options.test_frames);
  options.pose.lenses_suffice = true;
  const OutputFolder place(options.out, InputsOf(options), {"calibration.json"});
  PoseInput input = ReadPoseInput(options.pose, &report.notes);
  if (!options.sync.empty()) ApplySync(options.sync, &input, &report.notes);
  report.skeleton = input.skeleton;
  Posed posed = PosedCameras(input);
  const bool lenses_only = input.rig.gauge == calib::kLensesOnly;
  if (!lenses_only && options.person_height_m > 0) {
    throw UsageError("option 'person-height' is for lenses without poses; " + options.pose.calib +
                     " has poses, which keep its size");
  }
  const auto lengths = calib::LengthsOf(calib::ParseStatedLengths(options.lengths), input.skeleton.joints);
  if (lenses_only) PlaceCameras(lengths, &input, &posed, &report);
  if (!report.Placed()) return report;
  report.num_not_adjusted = input.rig.cameras.size() - posed.camera_of.size();
  report.refined = RefineFromKeypoints(posed.rig, posed.frames, input.limbs, train, test, options.adjust, run);
  if (lenses_only) report.refined.suspect = {};  // a placement by these joints is no calibration that could be wrong
  if (report.refined.status != Status::kOk) {
    report.causes = WhyNoFit(report, posed, run);
    return report;
  }
  CheckFit(posed, run, &report);
  report.written = report.refined.kept_input ? input.rig : Merge(input.rig, posed.camera_of, report.refined.rig);
  if (!ScaleWritten(lengths, posed, &report)) return report;
  report.path = options.out + "/calibration.json";
  geometry::WriteRig(report.written, report.path);
  return report;
}

}  // namespace mvstudio::stages
