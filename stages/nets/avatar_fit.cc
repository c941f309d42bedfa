#include "stages/nets/avatar_fit.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/fields.h"
#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "dataset/detect/models/models.h"
#include "stages/nets/avatar_dynamic.h"

namespace mvstudio::stages {
namespace {

using Json = nlohmann::ordered_json;

constexpr ChoiceWords<BodyFitMode, 3> kModes = {
    {{BodyFitMode::kAuto, "auto"}, {BodyFitMode::kGirths, "girths"}, {BodyFitMode::kOff, "off"}}};

Json StagesJson(const body::BodyFit& fit) {
  Json stages = Json::array();
  for (const body::BodyFitStage& stage : fit.stages) {
    stages.push_back({{"name", stage.name},
                      {"held_out_iou", FiniteOrNull(stage.held_out_iou)},
                      {"seconds", stage.seconds},
                      {"kept", stage.kept}});
  }
  return stages;
}

Json TemplatesJson(const avatar::PersonFit& person) {
  Json templates = Json::array();
  for (const avatar::TemplateFit& one : person.templates) {
    templates.push_back(
        {{"name", one.name}, {"held_out_iou", FiniteOrNull(one.held_out_iou)}, {"seconds", one.seconds}, {"kept", one.kept}});
  }
  return templates;
}

Json GainsJson(const avatar::PersonFit& person) {
  Json gains = Json::object();
  for (const auto& [camera, gain] : person.camera_gains) gains[camera] = {gain[0], gain[1], gain[2]};
  return gains;
}

Json CamerasJson(const body::BodyFit& fit) {
  Json cameras = Json::object();
  for (const body::CameraFit& camera : fit.cameras) {
    cameras[camera.name] = {{"silhouettes", camera.views},
                            {"rejected", camera.rejected},
                            {"iou_before", FiniteOrNull(camera.iou_before)},
                            {"iou", FiniteOrNull(camera.iou)},
                            {"shift_px", {camera.shift_px[0], camera.shift_px[1]}},
                            {"shift_sigma_px", camera.shift_sigma_px}};
  }
  return cameras;
}

/// A camera whose silhouettes lie beside the body: clearly, and by more than masks are usually off.
bool IsShifted(const body::CameraFit& camera) {
  constexpr double kLeastPx = 1, kSigmas = 4;
  return camera.shift_px.norm() > std::max(kLeastPx, kSigmas * camera.shift_sigma_px);
}

/// How well the surface is known: quantiles over the vertices, and the share that images determine to 10 mm.
Json SigmaJson(const body::BodyFit& fit) {
  if (fit.offset_sigma_m.size() == 0) return nullptr;
  const std::vector<double> sigma(fit.offset_sigma_m.begin(), fit.offset_sigma_m.end());
  const auto known = std::count_if(sigma.begin(), sigma.end(), [](double s) { return s < 0.01; });
  return {{"median", 1e3 * LinearQuantile(sigma, 0.5)},
          {"quantile_95", 1e3 * LinearQuantile(sigma, 0.95)},
          {"share_below_10", static_cast<double>(known) / static_cast<double>(sigma.size())}};
}

std::vector<body::RejectedView> Rejected(const avatar::PersonFit& person) {
  std::vector<body::RejectedView> all = person.fit.rejected;
  all.insert(all.end(), person.tracked.rejected.begin(), person.tracked.rejected.end());
  return all;
}

/// Training frames, and those in which cameras are scored that were not trained on.
std::vector<int> PosedFrames(const avatar::DatasetSplit& split) {
  std::vector<int> frames = split.train_frames;
  const auto add = [&](const std::vector<std::string>& scored_cameras, const std::vector<int>& more) {
    if (!scored_cameras.empty()) frames.insert(frames.end(), more.begin(), more.end());
  };
  add(split.holdout_cameras, split.holdout_frames);
  add(split.validation_cameras, split.validation_frames);
  return frames;
}

/// What can be a template by its name; other files may lie beside it.
bool IsBody(const std::filesystem::directory_entry& entry) {
  const std::string extension = entry.path().extension().string();
  return entry.is_directory() || extension == ".npz" || extension == ".pkl";
}

template <class T>
bool Holds(const std::vector<T>& list, const T& one) {
  return std::find(list.begin(), list.end(), one) != list.end();
}

/// The body and the masks share nothing.
bool NobodyOnMasks(const body::BodyFit& fit) {
  constexpr double kNothing = 0.01;
  return std::none_of(fit.cameras.begin(), fit.cameras.end(), [](const body::CameraFit& c) { return c.iou >= kNothing; });
}

/// The body lies beside the masks of a camera, or of most cameras.
CommandResult JudgeSilhouettes(const body::BodyFit& fit) {
  CommandResult result;
  constexpr double kLeastOfAll = 0.5, kUsual = 0.75;
  std::vector<double> ious;
  for (const body::CameraFit& camera : fit.cameras) {
    if (camera.views > camera.rejected && std::isfinite(camera.iou)) ious.push_back(camera.iou);
  }
  if (ious.empty()) return result;
  const double median = UpperMedian(ious, 0);
  const std::string text = Format("body and masks have an IoU of %.2f in the median camera", median);
  const std::string advice = "look at the masks: are they of these frames and cameras, upright, and 255 the person?";
  if (median < kLeastOfAll) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"BODY-POOR-FIT", text + ": the surface is not the person's, whatever its sigma says", advice});
    return result;
  }
  if (median < kUsual) result.warnings.push_back({"BODY-POOR-FIT", text + "; fits of good masks have 0.9", advice});
  for (const body::CameraFit& camera : fit.cameras) {
    if (!(camera.iou < kLeastOfAll)) continue;
    result.warnings.push_back({"BODY-POOR-FIT",
                               "camera " + camera.name + Format(": body and masks have an IoU of %.2f, ", camera.iou) +
                                   Format("in the median camera %.2f", median),
                               "look at its masks, its time offset and its calibration, or leave it out"});
  }
  return result;
}

bool WasJudged(const body::BodyFit& fit) { return std::isfinite(fit.iou); }

/// Why the bones alone were kept: offsets were no better, or better by no more than chance.
Notice NoGain(const std::vector<body::BodyFitStage>& stages) {
  double best = stages.front().held_out_iou;
  for (const body::BodyFitStage& stage : stages) best = std::max(best, stage.held_out_iou);
  if (best > stages.front().held_out_iou) {
    return {
        "BODY-NO-GAIN",
        Format("offsets of the surface raise the IoU of held-out silhouettes from %.4f to %.4f, but so few time steps cannot "
               "tell this from chance: only the lengths of the bones were fitted",
               stages.front().held_out_iou, best),
        "give more time steps; option 'max-silhouettes' thins them"};
  }
  return {"BODY-NO-GAIN",
          "offsets of the surface did not improve held-out silhouettes: only the lengths of the bones were fitted",
          "check masks and joints"};
}

}  // namespace

std::string_view ToString(BodyFitMode mode) { return WordOf(kModes, mode); }
void FromString(const std::string& text, BodyFitMode* mode) {
  *mode = KnownChoice(kModes, text, "option 'fit' " + text + ": must be auto, girths or off");
}

std::vector<std::string> TemplatesOf(const std::string& text) {
  namespace fs = std::filesystem;
  std::vector<std::string> templates;
  if (text == "auto") {
    const fs::path bodies = fs::path(detect::ModelsFolder()) / "bodies";
    if (fs::is_directory(bodies)) {
      for (const auto& entry : fs::directory_iterator(bodies)) {
        if (IsBody(entry)) templates.push_back(entry.path().string());
      }
    }
    std::sort(templates.begin(), templates.end());
    templates.insert(templates.begin(), "");
    return templates;
  }
  for (const std::string& name : SplitCommas(text)) {
    if (name != "mannequin" && !fs::exists(name))
      throw UsageError("option 'template' " + name + ": no such file or folder; it must be mannequin, auto, or a body");
    templates.push_back(name == "mannequin" ? "" : name);
  }
  if (templates.empty()) throw UsageError("option 'template' is empty: it must be mannequin, auto, or a body");
  return templates;
}

body::TexturedPerson BodyForSplit(const std::string& path, const avatar::DatasetSplit& split, avatar::PoseBy pose_by) {
  namespace fs = std::filesystem;
  const std::string file = fs::is_directory(path) ? path + "/" + body::kPersonFileName : path;
  body::TexturedPerson person = body::ReadPerson(file);
  const auto refuse = [&](const std::string& why) -> void {
    throw UsageError("option 'body' " + file + " " + why + ": fit it to this split's training images (`mvstudio avatar fit`)");
  };
  if (person.cameras.empty() || person.frames.empty()) refuse("does not say which images it was fitted to");
  for (const auto& [panel, node] : person.cameras) {
    const std::string name = Format("%02d_%02d", panel, node);
    if (!Holds(split.train_cameras, name)) refuse("was fitted to camera " + name + ", which is not trained on here");
  }
  for (const int frame : person.frames) {
    if (!Holds(split.train_frames, frame))
      refuse("was fitted to frame " + std::to_string(frame) + ", which is not trained on here");
  }
  const std::vector<int> posed = PosedFrames(split);
  for (const auto& [frame, pose] : person.person.seen) {
    const bool may = pose_by == avatar::PoseBy::kImages ? Holds(posed, frame) : Holds(split.train_frames, frame);
    if (!may) refuse("was posed by images of frame " + std::to_string(frame) + ", whose poses are not to be looked at here");
  }
  return person;
}

avatar::PersonFit FitToSplit(const dataset::PanopticDataset& data, const avatar::DatasetSplit& split, int person,
                             avatar::PoseBy pose_by, avatar::PersonFitOptions options, const RunContext& run) {
  options.cameras = split.train_cameras, options.frames = split.train_frames, options.person = person;
  if (pose_by == avatar::PoseBy::kImages) options.pose_frames = PosedFrames(split);
  return avatar::FitPerson(data, options, run);
}

Json ToJson(const avatar::PersonFit& person) {
  const body::BodyFit& fit = person.fit;
  int silhouettes = 0;
  for (const body::CameraFit& camera : fit.cameras) silhouettes += camera.views;
  Json rejected = Json::array();
  for (const body::RejectedView& view : Rejected(person))
    rejected.push_back({{"camera", view.camera}, {"frame", view.frame}, {"iou", view.iou}});
  return {{"vertices", person.result.person.body.vertices.cols()},
          {"silhouettes", silhouettes},
          {"missing", person.missing.size()},
          {"held_out_iou_before", FiniteOrNull(fit.iou_before)},
          {"held_out_iou", FiniteOrNull(fit.iou)},
          {"joint_error_mm", 1e3 * fit.joint_error_m},
          {"offset_rms_mm", fit.offsets.size() > 0 ? Json(1e3 * fit.offsets.norm() / std::sqrt(fit.offsets.size())) : Json()},
          {"surface_sigma_mm", SigmaJson(fit)},
          {"texels_seen", person.texture_seen},
          {"tracked",
           {{"frames", person.tracked.frames},
            {"iou_before", FiniteOrNull(person.tracked.iou_before)},
            {"iou", FiniteOrNull(person.tracked.iou)}}},
          {"camera_gains", GainsJson(person)},
          {"templates", TemplatesJson(person)},
          {"stages", StagesJson(fit)},
          {"dynamic", ToJson(person.dynamic)},
          {"cameras", CamerasJson(fit)},
          {"rejected", rejected}};
}

CommandResult JudgeFit(const avatar::PersonFit& person) {
  CommandResult result;
  const body::BodyFit& fit = person.fit;
  if (NobodyOnMasks(fit)) {  // everything else would follow from it
    result.exit = kExitQualityGate;
    result.errors.push_back({"BODY-NO-SILHOUETTE",
                             "the body lies on no mask of any camera (IoU 0): nothing was fitted to the silhouettes",
                             "look at the masks: 255 must be the person; are they of these frames and cameras?"});
    return result;
  }
  const auto warn = [&](const char* code, const std::string& what, const char* advice) {
    result.warnings.push_back({code, what, advice});
  };
  if (const std::vector<body::RejectedView> rejected = Rejected(person); !rejected.empty()) {
    const body::RejectedView& first = rejected.front();
    warn("BODY-REJECTED",
         std::to_string(rejected.size()) + " silhouettes do not fit the person and were left out; the first: camera " +
             first.camera + ", frame " + std::to_string(first.frame) + Format(" (IoU %.2f)", first.iou),
         "look at these masks");
  }
  for (const body::CameraFit& camera : fit.cameras) {
    if (!IsShifted(camera)) continue;
    warn("BODY-CAMERA-SHIFT",
         "the silhouettes of camera " + camera.name +
             Format(" lie (%.1f, %.1f) px beside the fitted body, +- %.1f px", camera.shift_px[0], camera.shift_px[1],
                    camera.shift_sigma_px),
         "check its calibration, its time offset and its masks");
  }
  result.Add(JudgeSilhouettes(fit));
  if (!WasJudged(fit)) {
    warn("BODY-NOT-JUDGED",
         "too few images to hold some out, so nobody can say whether a fitted surface is better: only the lengths of the bones "
         "were fitted",
         "give at least four images, better ten frames of several cameras");
  } else if (fit.stages.size() > 1 && fit.stages.front().kept) {
    result.warnings.push_back(NoGain(fit.stages));
  }
  if (!person.missing.empty()) {
    warn("BODY-MISSING",
         std::to_string(person.missing.size()) +
             " images or masks do not exist and were left out; the first: " + person.missing.front(),
         "build them, or leave these cameras and frames out");
  }
  return result;
}

std::string ToTable(const avatar::PersonFit& person) {
  std::string text;
  if (NobodyOnMasks(person.fit)) return text;
  for (const avatar::TemplateFit& one : person.templates) {
    if (person.templates.size() > 1)
      text += Format("template %s: held-out IoU %.4f, %.1f s%s\n", one.name.c_str(), one.held_out_iou, one.seconds,
                     one.kept ? ", kept" : "");
  }
  text += "stage                               held-out IoU   seconds\n";
  for (const body::BodyFitStage& stage : person.fit.stages)
    text += Format("%-36s%12.4f%10.1f%s\n", stage.name.c_str(), stage.held_out_iou, stage.seconds, stage.kept ? "  kept" : "");
  if (person.fit.cameras.size() == 1)
    text += "one camera: no poses by brightness, and a softer surface only where it lowers the held-out loss by a tenth\n";
  text += "\ncamera        silhouettes  rejected  IoU before   after   shift, px\n";
  for (const body::CameraFit& camera : person.fit.cameras) {
    text += Format("%-14s%11d%10d%12.4f%8.4f   %.2f, %.2f\n", camera.name.c_str(), camera.views, camera.rejected,
                   camera.iou_before, camera.iou, camera.shift_px[0], camera.shift_px[1]);
  }
  const Json sigma = SigmaJson(person.fit);
  if (!sigma.is_null()) {
    text +=
        Format("\nsurface: standard deviation %.1f mm in the median, %.1f at 95 %%; %.0f %% of it known to 10 mm\n",
               sigma["median"].get<double>(), sigma["quantile_95"].get<double>(), 100 * sigma["share_below_10"].get<double>());
  }
  text += ToTable(person.dynamic);
  if (person.tracked.frames > 0) {
    text += Format("\n%d further frames posed by images: IoU %.4f by joints alone, %.4f\n", person.tracked.frames,
                   person.tracked.iou_before, person.tracked.iou);
  }
  return text;
}

}  // namespace mvstudio::stages
