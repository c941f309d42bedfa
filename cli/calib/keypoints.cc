#include "cli/calib/keypoints.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/calibrate.h"
#include "calib/keypoints/moments.h"
#include "calib/keypoints/place.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/units.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"
#include "stages/calib/stated_lengths.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_input.h"
#include "stages/people/apply_sync.h"
#include "stages/people/known_lengths.h"
#include "stages/people/likely_cause.h"
#include "stages/report_fields.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

ordered_json Pair(double before, double after) { return {{"before", FiniteOrNull(before)}, {"after", FiniteOrNull(after)}}; }

ordered_json Vector(const Eigen::Vector2d& v) { return ordered_json::array({FiniteOrNull(v.x()), FiniteOrNull(v.y())}); }

std::optional<calib::FrameChoice> ParseFrames(const std::string& flag, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const size_t colon = text.find(':');
  const auto number = [&](const std::string& digits) {
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos)
      throw UsageError(flag + " " + text + ": give START:STEP, e.g. 0:4 for frames 0, 4, 8, ...");
    return std::stoi(digits);
  };
  calib::FrameChoice choice{number(text.substr(0, colon)), colon == std::string::npos ? 0 : number(text.substr(colon + 1))};
  if (choice.step < 1) throw UsageError(flag + " " + text + ": the step must be at least 1 (START:STEP)");
  return choice;
}

/// The rig's cameras that have poses, and the frames with those cameras alone.
struct Posed {
  geometry::Rig rig;
  std::vector<size_t> camera_of;  // index in the whole rig
  std::vector<triangulate::DetectedFrame> frames;
};

Posed PosedCameras(const stages::PoseInput& input) {
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

ordered_json CameraJson(const calib::KeypointCamera& camera, const geometry::Camera& lens, const std::string& distortion) {
  return {{"name", camera.name},
          {"rotation_deg", FiniteOrNull(RadToDeg(camera.rotation_rad))},
          {"rotation_sigma_deg", FiniteOrNull(RadToDeg(camera.rotation_sigma_rad))},
          {"translation_mm", FiniteOrNull(1e3 * camera.translation_m)},
          {"translation_sigma_mm", FiniteOrNull(1e3 * camera.translation_sigma_m)},
          {"focal_change_percent", FiniteOrNull(100 * camera.focal_change)},
          {"mean_residual_px",
           {{"before", Vector(camera.mean_residual_before_px)}, {"after", Vector(camera.mean_residual_after_px)}}},
          {"distortion", distortion},
          {"model", std::string(geometry::ToString(lens.model))},
          {"num_detections", camera.num_detections}};
}

ordered_json CulpritJson(const calib::KeypointCulprit& culprit) {
  if (culprit.fault == calib::CameraFault::kNone) return nullptr;
  ordered_json json = {{"camera", culprit.corrected.camera.name},
                       {"fault", calib::ToString(culprit.fault)},
                       {"message", culprit.message},
                       {"explained", FiniteOrNull(culprit.explained)}};
  if (culprit.fault == calib::CameraFault::kPose) {
    json["rotation_deg"] = FiniteOrNull(RadToDeg(culprit.rotation_rad));
    json["rotation_sigma_deg"] = FiniteOrNull(RadToDeg(culprit.rotation_sigma_rad));
    json["translation_mm"] = FiniteOrNull(1e3 * culprit.translation_m);
    json["translation_sigma_mm"] = FiniteOrNull(1e3 * culprit.translation_sigma_m);
  } else {
    json["scale"] = FiniteOrNull(culprit.scale);
    json["scale_sigma"] = FiniteOrNull(culprit.scale_sigma);
  }
  return json;
}

ordered_json HeldOutJson(const calib::KeypointHeldOut& part) {
  return {{"part", part.name},
          {"first_frame", part.first_frame},
          {"last_frame", part.last_frame},
          {"num_frames", part.num_frames},
          {"num_train_frames", part.num_train_frames},
          {"kept_input", part.kept_input},
          {"median_px", Pair(part.before.median_px, part.after.median_px)},
          {"mean_px", Pair(part.before.mean_px, part.after.mean_px)},
          {"p90_px", Pair(part.before.p90_px, part.after.p90_px)},
          {"limb_std_mm", Pair(part.before.limb_std_mm, part.after.limb_std_mm)}};
}

void FillMetrics(const calib::KeypointRefineReport& report, ordered_json* metrics) {
  ordered_json& m = *metrics;
  const calib::KeypointError &before = report.before, &after = report.after;
  m["holdout_median_px"] = Pair(before.median_px, after.median_px);
  m["holdout_mean_px"] = Pair(before.mean_px, after.mean_px);
  m["holdout_p90_px"] = Pair(before.p90_px, after.p90_px);
  m["limb_std_mm"] = Pair(before.limb_std_mm, after.limb_std_mm);
  m["limb_mean_mm"] = Pair(before.limb_mean_mm, after.limb_mean_mm);
  m["num_holdout_joints"] = after.num_joints;
  m["num_holdout_failed"] = {{"before", before.num_failed}, {"after", after.num_failed}};
  m["kept_input"] = report.kept_input;
  m["keypoint_sigma_px"] = FiniteOrNull(report.sigma_px);
  m["keypoint_cauchy_px"] = FiniteOrNull(report.cauchy_px);
  m["num_train_frames"] = report.num_train_frames;
  m["num_test_frames"] = report.num_test_frames;
  m["num_train_joints"] = report.num_train_joints;
  m["held_out"] = ordered_json::array();
  for (const calib::KeypointHeldOut& part : report.held_out) m["held_out"].push_back(HeldOutJson(part));
  m["num_gap_frames"] = report.num_gap_frames;
  m["left_out_persons"] = {{"num_persons", report.left_out.num_persons}, {"num_frames", report.left_out.frames.size()}};
  m["culprit"] = CulpritJson(report.culprit);
  m["cameras"] = ordered_json::array();
  for (size_t c = 0; c < report.cameras.size(); ++c)
    m["cameras"].push_back(
        CameraJson(report.cameras[c], report.rig.cameras[c].camera, calib::ToString(report.plan.distortion)));
  m["decisions"] = stages::RowsJson(report.decisions);
}

std::string Limbs(const calib::KeypointError& error) {
  if (!std::isfinite(error.limb_mean_mm)) return "";
  return "; limbs " + stages::LengthText(error.limb_mean_mm / 1e3) + " long +- " + stages::LengthText(error.limb_std_mm / 1e3);
}

std::string Line(const calib::KeypointCamera& c, bool kept) {
  const std::string moved =
      kept ? "as given"
           : Format("turned %.3f +- %.3f deg, moved %.1f +- %.1f mm, focal %+.2f %%", RadToDeg(c.rotation_rad),
                    RadToDeg(c.rotation_sigma_rad), 1e3 * c.translation_m, 1e3 * c.translation_sigma_m, 100 * c.focal_change);
  return Format("%-16s %s, mean residual (%+.1f, %+.1f) -> (%+.1f, %+.1f) px\n", c.name.c_str(), moved.c_str(),
                c.mean_residual_before_px.x(), c.mean_residual_before_px.y(), c.mean_residual_after_px.x(),
                c.mean_residual_after_px.y());
}

std::string Summary(const calib::KeypointRefineReport& report) {
  std::string text;
  for (const auto& [name, error] : {std::pair("before", &report.before), std::pair("after", &report.after)})
    text += Format("held-out frames %-6s median %.2f px, mean %.2f px, p90 %.1f px%s\n", name, error->median_px, error->mean_px,
                   error->p90_px, Limbs(*error).c_str());
  for (const calib::KeypointHeldOut& part : report.held_out)
    text += Format("  %-12s frames %d to %d (%d), adjusted to %d others: median %.2f -> %.2f px, mean %.2f -> %.2f px%s\n",
                   part.name.c_str(), part.first_frame, part.last_frame, part.num_frames, part.num_train_frames,
                   part.before.median_px, part.after.median_px, part.before.mean_px, part.after.mean_px,
                   part.kept_input ? " (input kept)" : "");
  if (report.num_gap_frames > 0)
    text += Format("  %d frames between the halves measure neither; the calibration is adjusted to all %d frames\n",
                   report.num_gap_frames, report.num_train_frames);
  for (const calib::KeypointCamera& c : report.cameras) text += Line(c, report.kept_input);
  text += Format("%-16s %-28s %10s %10s\n", "group", "choice", "held-out", "std. error");
  for (const calib::KeypointDecision& d : report.decisions)
    text += Format("%-16s %-28s %7.3f px %7.3f px%s\n", d.group.c_str(), d.choice.c_str(), d.holdout_px, d.standard_error_px,
                   d.chosen            ? "  <-"
                   : d.refusal.empty() ? ""
                                       : ("  " + d.refusal).c_str());
  if (report.culprit.fault != calib::CameraFault::kNone) text += report.culprit.message + "\n";
  if (report.kept_input) text += report.message + "\n";
  return text;
}

triangulate::CauseOptions CauseOptionsOf(const KeypointArguments& arguments) {
  triangulate::CauseOptions options;
  options.min_score = arguments.options.min_score, options.max_persons = arguments.options.max_persons;
  return options;
}

/// The causes of a take of which less than half fits the given rig; nothing else is looked at.
std::optional<triangulate::CauseReport> WhyNoFit(const KeypointArguments& arguments, const Posed& posed,
                                                 const triangulate::TakeBody& body, const RunContext& run) {
  const triangulate::CauseOptions options = CauseOptionsOf(arguments);
  if (FitAsGiven(posed.rig, posed.frames, options, run).carried >= 0.5) return std::nullopt;
  return RankCauses(posed.rig, posed.frames, body, options, run);
}

/// What part of a sample of the detections fits. Exit 4 where that is next to nothing, or where one assumption about what is
/// wrong explains the take better than the adjustment does.
void CheckLoss(const KeypointArguments& arguments, const Posed& posed, const calib::KeypointRefineReport& report,
               const triangulate::TakeBody& body, const RunContext& run, CommandResult* result) {
  const triangulate::CauseTrial after = FitAsGiven(report.rig, posed.frames, CauseOptionsOf(arguments), run);
  result->metrics["detections_carried"] = after.carried;
  if (after.num_detections == 0) return;
  // A camera that is late by a frame bends the rig where its time is not what the others' is.
  const triangulate::CauseReport timing = CheckTiming(report.rig, posed.frames, CauseOptionsOf(arguments), run);
  const stages::CauseFinding late = stages::CauseInTiming(timing, !arguments.sync.empty());
  result->Add(late.said);
  if (!late.clear && !report.unsteady.empty()) {
    if (!report.kept_input) result->exit = kExitQualityGate;
    (report.kept_input ? result->warnings : result->errors)
        .push_back(
            {"CAL-UNSTEADY", report.unsteady,
             "cameras that are not synchronous (`mvstudio sync`, --sync), that moved during the take, or wrong names do this"});
  }
  const auto why = WhyNoFit(arguments, posed, body, run);
  const auto cause = stages::CauseOfLoss(why, "CAL-CAUSE", "check that calibration and poses belong to the same cameras");
  result->Add(cause.said);
  // Exchanged cameras can be adjusted until they fit: the given world is then lost.
  const bool over = std::any_of(report.cameras.begin(), report.cameras.end(),
                                [](const auto& camera) { return camera.rotation_rad > 0.5 * kPi; });
  const bool explained = why && !why->message.empty() && (over || why->trials[0].residual_px < after.residual_px);
  if (after.carried >= stages::kLostShare && !explained) return;
  result->exit = kExitQualityGate;
  result->errors.push_back({"CAL-NOFIT",
                            Format("%.1f %% of the detections fit the calibration that was written, mean residual %.2f px%s",
                                   100 * after.carried, after.residual_px, over ? ", and it turns cameras over" : ""),
                            cause.remedy});
}

/// The whole rig with the adjusted cameras in their places.
geometry::Rig Merge(const geometry::Rig& whole, const std::vector<size_t>& camera_of, const geometry::Rig& adjusted) {
  if (camera_of.size() == whole.cameras.size()) return adjusted;
  geometry::Rig merged = whole;
  merged.joint_covariance.reset(), merged.gauge = adjusted.gauge;
  for (size_t i = 0; i < camera_of.size(); ++i) merged.cameras[camera_of[i]] = adjusted.cameras[i];
  return merged;
}

std::string LeftOutLine(const calib::LeftOutPersons& others, int max_persons) {
  const size_t count = others.frames.size();
  return Format("%d more %s than --max-persons %d, in %zu %s (%s%d): left out", others.num_persons,
                others.num_persons == 1 ? "person" : "persons", max_persons, count, count == 1 ? "frame" : "frames",
                count == 1 ? "" : "the first: ", others.frames.front());
}

void AddWarnings(const calib::KeypointRefineReport& report, size_t num_left_out, int max_persons, CommandResult* result) {
  if (report.kept_input)
    result->warnings.push_back({"CAL-INPUT-KEPT", report.message, "film more, in more of the space, or recalibrate"});
  if (report.culprit.fault != calib::CameraFault::kNone)
    result->warnings.push_back({"CAL-CAMERA-WRONG", report.culprit.message,
                                "the new calibration corrects it; check the camera and its images all the same"});
  if (num_left_out > 0)
    result->warnings.push_back(
        {"CAL-NOT-ADJUSTED", std::to_string(num_left_out) + " cameras without 2D points stay as they are", "give theirs too"});
  if (!report.left_out.frames.empty())
    result->warnings.push_back(
        {"CAL-PERSONS-LEFT-OUT", LeftOutLine(report.left_out, max_persons),
         "--max-persons " + std::to_string(max_persons + report.left_out.num_persons) + " uses them too"});
  if (!report.lenses.empty())
    result->warnings.push_back(
        {"CAL-LENSES", report.lenses, "boards determine lenses; --no-keypoint-lenses leaves them as given"});
  for (const std::string& note : report.notes)
    result->warnings.push_back({"CAL-HALF-UNSOLVED", note, "the held-out figures are those of the other half alone"});
}

/// The rig as large as --length says. False: what it names was not measured.
bool ScaleByLengths(const std::vector<calib::StatedLength>& lengths, const std::vector<std::string>& joints,
                    const KeypointArguments& arguments, const Posed& posed, const geometry::Rig& adjusted, geometry::Rig* rig,
                    CommandResult* result) {
  const auto moments = MomentsOf(adjusted, posed.frames, joints, arguments.options);
  const calib::LengthScale scale = ScaleFromLengths(lengths, moments);
  result->Add(stages::DescribeLengths(scale));
  if (scale.status != Status::kOk) return false;
  *rig = geometry::InWorld(*rig, {}, scale.scale);
  rig->gauge.stated_lengths = true;
  return true;
}

/// Lenses without poses: the cameras with 2D points become a rig by the person alone. False: they cannot.
bool PlaceCameras(const KeypointArguments& arguments, const std::vector<calib::StatedLength>& stated, stages::PoseInput* input,
                  Posed* posed, CommandResult* result) {
  const double height_m = arguments.person_height_m > 0 ? arguments.person_height_m : 1.7;
  const bool by_height = stated.empty() && input->skeleton.human && input->skeleton.lengths.empty();
  const calib::PlacedRig placed = PlaceFromKeypoints(posed->rig, posed->frames,
                                                     stated.empty() ? stages::KnownLengthsOf(input->skeleton, height_m)
                                                                    : calib::KnownLengthsOf(stated, input->skeleton.joints),
                                                     arguments.options.min_score);
  if (placed.status != Status::kOk) {
    result->exit = kExitIllPosed;
    result->errors.push_back({"CAL-UNPLACED", placed.message,
                              "one person who walks through what all cameras see, and a skeleton whose bones have lengths"});
    return false;
  }
  result->metrics["placed"] = {{"inlier_share", placed.inlier_share}, {"length_spread", placed.length_spread}};
  const std::string by =
      input->skeleton.human ? Format("a person of %.2f m", height_m) : "the lengths of " + input->skeleton.name;
  if (by_height && !(arguments.person_height_m > 0))
    result->warnings.push_back(
        {"CAL-SCALE", "the rig's size rests on " + by + ", which is assumed", "--person-height states it"});
  result->warnings.push_back({"CAL-WORLD",
                              "cameras placed by people: the world is that of " + placed.rig.cameras[0].camera.name,
                              "mvstudio calib align --floor-joints, or --floor-board, sets the floor"});
  if (placed.rig.cameras.size() < input->rig.cameras.size())
    result->warnings.push_back({"CAL-LEFTOUT", "cameras without 2D points are not in the rig", "give theirs too"});
  posed->rig = input->rig = placed.rig;
  for (size_t c = 0; c < posed->camera_of.size(); ++c) posed->camera_of[c] = c;
  return true;
}

}  // namespace

void AddKeypointArguments(CLI::App* sub, KeypointArguments& arguments) {
  StartGroup(sub, "People, markers or animals");
  AddFlag(sub, "--from-keypoints", arguments.from_keypoints,
          "adjust to what several cameras see at once, --pose2d or --points2d, instead of boards");
  AddChoices(
      sub, "--pose2d", arguments.pose2d,
      "--from-keypoints: NAME=FOLDER of OpenPose JSON files, or NAME=FILE of DeepLabCut, SLEAP, MMPose, …; repeat for each "
      "camera");
  AddOption(sub, "--points2d", arguments.points2d,
            "instead: table camera,frame,person,joint,x_px,y_px,score (CSV) of all cameras, for markers, wands and animals; "
            "joints may be names or numbers, frames need no connection in time");
  AddOption(sub, "--skeleton", arguments.skeleton,
            "--from-keypoints: a name that triangulate knows, or a file FILE.toml (docs/formats.md); body25 unless given, of "
            "--points2d, DeepLabCut and SLEAP the points in the file");
  AddOption(sub, "--unit,--calib-unit", arguments.calib_unit,
            "--from-keypoints: m, cm, mm or in: of a calibration that names no unit; m unless given");
  AddOption(sub, "--sync", arguments.sync,
            "--from-keypoints: sync.json of `mvstudio sync`: time offsets and rates of the cameras");
  AddOptions(sub, arguments.changes);
  AddOption(sub, "--train-frames", arguments.train_frames,
            "--from-keypoints: START:STEP; frames to adjust to, the others (or --test-frames) only measure the result; "
            "without both, each half of the take measures what was adjusted to the other, and the rig is adjusted to all");
  AddOption(sub, "--test-frames", arguments.test_frames, "--from-keypoints: START:STEP; frames that measure the result");
  AddOption(sub, "--length", arguments.lengths, std::string("--from-keypoints: ") + stages::kLengthHelp)->take_all();
  AddOption(sub, "--person-height", arguments.person_height_m,
            "metres; --from-keypoints with lenses that have no poses: the cameras are placed by the person, whose height gives "
            "the rig's size; 1.7 is assumed; own skeletons state lengths instead")
      ->check(CLI::Range(0.3, 2.8));
  AddOptions(sub, arguments.options);
}

CommandResult RunKeypoints(const KeypointArguments& arguments, const std::string& calib_path, const std::string& out,
                           CommandContext& context) {
  CommandResult result;
  const auto train = ParseFrames("--train-frames", arguments.train_frames);
  const auto test = ParseFrames("--test-frames", arguments.test_frames);
  stages::PoseArguments pose;
  pose.lenses_suffice = true;
  pose.calib = calib_path, pose.calib_unit = arguments.calib_unit, pose.skeleton = arguments.skeleton;
  pose.pose2d = arguments.pose2d, pose.points2d = arguments.points2d, pose.changes = arguments.changes;
  const OutputFolder place(out, Joined(PathsIn(arguments.pose2d), {calib_path, arguments.points2d, arguments.sync}),
                           {"calibration.json"});
  stages::PoseInput input = stages::ReadPoseInput(pose, &result);
  if (!arguments.sync.empty()) stages::ApplySync(arguments.sync, &input, &result);
  Posed posed = PosedCameras(input);
  const bool lenses_only = input.rig.gauge == calib::kLensesOnly;
  if (!lenses_only && arguments.person_height_m > 0)
    throw UsageError("--person-height is for lenses without poses; " + calib_path + " has poses, which keep its size");
  const auto lengths = calib::LengthsOf(calib::ParseStatedLengths(arguments.lengths), input.skeleton.joints);
  if (lenses_only && !PlaceCameras(arguments, lengths, &input, &posed, &result)) return result;
  const calib::KeypointRefineReport report =
      RefineFromKeypoints(posed.rig, posed.frames, input.limbs, train, test, arguments.options, context.run);
  result.metrics["status"] = std::string(ToString(report.status));
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    const auto cause = stages::CauseOfLoss(WhyNoFit(arguments, posed, stages::BodyOf(input.skeleton), context.run), "CAL-CAUSE",
                                           "people or markers must be seen by several cameras at once, in many places");
    result.Add(cause.said);
    result.errors.push_back({"CAL-UNSOLVED", report.message, cause.remedy});
    result.text = report.message + "\n";
    return result;
  }
  FillMetrics(report, &result.metrics);
  AddWarnings(report, input.rig.cameras.size() - posed.camera_of.size(), arguments.options.max_persons, &result);
  CheckLoss(arguments, posed, report, stages::BodyOf(input.skeleton), context.run, &result);
  geometry::Rig written = report.kept_input ? input.rig : Merge(input.rig, posed.camera_of, report.rig);
  if (!lengths.empty() && !ScaleByLengths(lengths, input.skeleton.joints, arguments, posed, report.rig, &written, &result))
    return result;
  result.folder = out;
  result.outputs.push_back({out + "/calibration.json", "calibration"});
  geometry::WriteRig(written, result.outputs.back().path);
  result.text = Summary(report) + result.text;
  if (lenses_only)
    result.text += "all frames placed the cameras first: the figures above are held out from the adjustment alone\n";
  result.Add(stages::DescribeWrittenCovariance(written));
  return result;
}

}  // namespace mvstudio::cli
