#include <cstdio>
#include <filesystem>

#include "cli/calib/calib.h"
#include "cli/calib/page_server.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/frames.h"
#include "stages/click/click_page.h"
#include "stages/click/click_scene.h"
#include "stages/input/calib_read.h"
#include "stages/input/session_input.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;
namespace fs = std::filesystem;

struct ClickArguments {
  std::vector<stages::NamedPath> cameras;
  stages::SessionArguments session;
  std::string points, calib, out;
  int frame = 0, port = 0;
  calib::PointResectionOptions resection;
};

/// The image with this number, or the next one that there is.
Image ImageOf(const stages::NamedPath& camera, int frame) {
  const auto source = dataset::OpenFrames(camera.path, {false, false, true});
  while (const auto found = source->Advance()) {
    if (found->number >= frame) return source->Picture();
  }
  throw UsageError("--frame " + std::to_string(frame) + ": " + camera.path + " of camera " + camera.name + " ends before it");
}

void FillFromSession(ClickArguments* arguments, CommandResult* result) {
  const auto found = stages::FindTake(arguments->session, result);
  if (!found) return;
  if (arguments->calib.empty()) arguments->calib = dataset::CalibrationOf(found->session, arguments->session.allow_outside);
  if (arguments->out.empty()) arguments->out = (fs::path(found->session.folder) / "calib" / "clicks.csv").string();
  if (!arguments->cameras.empty()) return;
  for (const dataset::SessionFootage& f : found->take.footage)
    arguments->cameras.push_back(
        {f.camera, dataset::ResolveInSession(found->session, f.path, arguments->session.allow_outside)});
}

void ReadPoints(const ClickArguments& arguments, stages::ClickScene* scene) {
  std::vector<std::string> files = {arguments.points};
  if (fs::exists(arguments.out)) files.push_back(arguments.out);
  const std::vector<std::string> others = stages::AddPoints(calib::ReadScenePlaces(files), scene);
  if (scene->names.empty()) throw FormatError(arguments.points, "", "holds no point");
  if (!others.empty())
    throw UsageError(arguments.out + " has clicks of camera " + others[0] +
                     ", which is not given: give it too, or another --out");
}

stages::ClickScene ReadScene(const ClickArguments& arguments, CommandResult* result) {
  if (arguments.cameras.empty()) throw UsageError("--camera NAME=PATH is needed at least once, or a --session with footage");
  geometry::Rig lenses;
  if (!arguments.calib.empty()) {
    const calib::ImportedRig given = stages::ReadCalibrationFiles({arguments.calib}, {});
    stages::AddNotes(given.notes, result);
    lenses = given.rig;
    result->inputs.push_back(arguments.calib);
  }
  stages::ClickScene scene;
  for (const stages::NamedPath& camera : arguments.cameras) {
    const int known = lenses.Find(camera.name);
    const auto lens = known < 0 ? std::nullopt : std::optional(lenses.cameras[static_cast<size_t>(known)].camera);
    stages::AddCamera(camera.name, ImageOf(camera, arguments.frame), lens, &scene);
    result->inputs.push_back(camera.path);
  }
  ReadPoints(arguments, &scene);
  result->inputs.push_back(arguments.points);
  return scene;
}

/// What the page asks for; clicks are saved as they come.
class ClickPage {
 public:
  ClickPage(const ClickArguments& arguments, stages::ClickScene* scene) : arguments_(arguments), scene_(scene) {}

  PageAnswer operator()(const PageRequest& request) {
    if (request.method == "POST") return Post(request);
    const std::string& path = request.path;
    if (path.empty()) return {200, "text/html; charset=utf-8", stages::ClickPageHtml()};
    if (path == "click.css") return {200, "text/css; charset=utf-8", stages::ClickPageStyle()};
    if (path == "click.js") return {200, "text/javascript; charset=utf-8", stages::ClickPageScript()};
    if (path == "scene.json") return {200, "application/json", stages::SceneJsonText(*scene_, arguments_.resection)};
    for (size_t c = 0; c < scene_->cameras.size(); ++c) {
      if (path == "image/" + std::to_string(c) + ".jpg") return {200, "image/jpeg", scene_->cameras[c].jpeg};
    }
    return {404, "text/plain; charset=utf-8", "not here\n"};
  }
  bool is_finished() const { return is_finished_; }

 private:
  PageAnswer Post(const PageRequest& request) {
    if (request.path == "finish") {
      is_finished_ = true;
      return {};
    }
    if (request.path != "clicks.json") return {404, "text/plain; charset=utf-8", "not here\n"};
    stages::SentClicks sent = stages::ReadSentClicks(request.body, *scene_);
    const bool newest = sent.revision == scene_->revision;  // else another page has saved: what that one saved is the answer
    if (newest) Save(std::move(sent.clicks));
    return {newest ? 200 : 409, "application/json", stages::ClicksJsonText(*scene_, arguments_.resection)};
  }

  /// The scene holds what the table holds.
  void Save(stages::ClickMap clicks) {
    std::swap(scene_->clicks, clicks);
    try {
      WriteFileAtomic(arguments_.out, stages::ClicksCsv(*scene_));
    } catch (...) {
      std::swap(scene_->clicks, clicks);
      throw;
    }
    ++scene_->revision;
  }

  const ClickArguments& arguments_;
  stages::ClickScene* scene_;
  bool is_finished_ = false;
};

void Describe(const stages::ClickScene& scene, const ClickArguments& arguments, CommandResult* result) {
  result->metrics["num_points"] = scene.names.size();
  result->metrics["num_clicks"] = scene.clicks.size();
  result->metrics["cameras"] = ordered_json::array();
  for (size_t c = 0; c < scene.cameras.size(); ++c) {
    const stages::ClickFit fit = stages::FitClicks(scene, static_cast<int>(c), arguments.resection);
    const std::string& name = scene.cameras[c].name;
    result->metrics["cameras"].push_back({{"name", name},
                                          {"status", std::string(ToString(fit.status))},
                                          {"num_clicks", fit.num_clicks},
                                          {"rms_px", FiniteOrNull(fit.rms_px)},
                                          {"leave_one_out_px", FiniteOrNull(fit.leave_one_out_px)}});
    result->text += Format("%-16s %d of %zu points", name.c_str(), fit.num_clicks, scene.names.size());
    result->text += fit.status == Status::kOk
                        ? Format(", rms %.2f px, left-out points %.2f px\n", fit.rms_px, fit.leave_one_out_px)
                        : ": " + fit.message + "\n";
    for (const int point : fit.rejected) {
      result->warnings.push_back({"CAL-CLICK",
                                  "camera " + name + ": point " + scene.names[static_cast<size_t>(point)] + " is off",
                                  "mark it again, or check its coordinates"});
    }
  }
}

std::string WhatIsSaved(const stages::ClickScene& scene, const CommandResult& result, const std::string& out) {
  const size_t count = scene.clicks.size();
  if (result.outputs.empty()) return "no click was made, so " + out + " was not written";
  return std::to_string(count) + (count == 1 ? " click is in " : " clicks are in ") + out;
}

CommandResult RunClick(ClickArguments arguments, CommandContext& context) {
  CommandResult result;
  FillFromSession(&arguments, &result);
  if (arguments.out.empty()) throw UsageError("--out is required, or a --session to write to");
  const OutputFiles place({arguments.out}, Joined(PathsIn(arguments.cameras), {arguments.points, arguments.calib}));
  stages::ClickScene scene = ReadScene(arguments, &result);
  ClickPage page(arguments, &scene);
  PageServer server(arguments.port, std::ref(page));
  // Nothing works without this line, so it does not depend on the log's level.
  std::fprintf(stderr, "open %s in a browser on this machine; its button Finish, or Ctrl-C here, ends it\n",
               server.url().c_str());
  std::fflush(stderr);
  const auto interrupted = [&] { return context.run.progress && context.run.progress->Cancelled(); };
  server.Run([&] { return page.is_finished() || interrupted(); });
  if (fs::exists(arguments.out)) result.outputs.push_back({arguments.out, "clicks"});
  Describe(scene, arguments, &result);
  if (interrupted()) throw CancelledError("interrupted; " + WhatIsSaved(scene, result, arguments.out));
  return result;
}

}  // namespace

void RegisterCalibClick(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<ClickArguments>();
  CLI::App* sub = calib.add_subcommand(
      "click", "Click points in the cameras' images, in a browser on this machine, for calibrate --scene-points");
  AddOption(sub, "--points", arguments->points,
            "CSV name,x,y,z (metres), or names alone: the points, in the order in which they are offered")
      ->required();
  AddChoices(sub, "--camera", arguments->cameras,
             "NAME=PATH: an image, a video, a folder or a pattern in quotes; repeat for each camera")
      ->allow_extra_args(true);
  AddSessionArguments(sub, arguments->session, "footage and calibration", "people");
  AddOption(sub, "--calib", arguments->calib, "calibration with the cameras' lenses: residuals are shown while you click");
  AddOption(sub, "--frame", arguments->frame, "number of the frame or image that is shown, or the next one")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  AddOutput(
      sub, "--out", arguments->out, OutputKind::kFile,
      "table camera,point,x_px,y_px, saved after each click and gone on with when it is there; SESSION/calib/clicks.csv unless "
      "given");
  AddOption(sub, "--port", arguments->port, "port on 127.0.0.1; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  AddOption(sub, "--click-sigma-px", arguments->resection.click_sigma_px, "px; how well you click, per coordinate")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  registry.Add(sub, "calib click", [arguments](CommandContext& context) { return RunClick(*arguments, context); });
}

}  // namespace mvstudio::cli
