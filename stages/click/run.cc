#include "stages/click/run.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/frames.h"
#include "stages/click/click_page.h"
#include "stages/input/calib_read.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

/// The image with this number, or the next one that there is.
Image ClickImageOf(const NamedPath& camera, int frame) {
  const auto source = dataset::OpenFrames(camera.path, {false, false, true});
  while (const auto found = source->Advance()) {
    if (found->number >= frame) return source->FullImage();
  }
  throw UsageError("option 'frame' " + std::to_string(frame) + ": " + camera.path + " of camera " + camera.name +
                   " ends before it");
}

void FillClicksFromSession(ClickOptions* options, InputNotes* notes) {
  const auto found = FindTake(options->session, notes);
  if (!found) return;
  if (options->calib.empty()) options->calib = dataset::CalibrationOf(found->session, options->session.allow_outside);
  if (options->out.empty()) options->out = (fs::path(found->session.folder) / "calib" / "clicks.csv").string();
  if (!options->cameras.empty()) return;
  for (const dataset::SessionFootage& f : found->take.footage)
    options->cameras.push_back({f.camera, dataset::ResolveInSession(found->session, f.path, options->session.allow_outside)});
}

void ReadClickPoints(const ClickOptions& options, ClickScene* scene) {
  std::vector<std::string> files = {options.points};
  if (fs::exists(options.out)) files.push_back(options.out);
  const std::vector<std::string> others = AddPoints(calib::ReadScenePlaces(files), scene);
  if (scene->names.empty()) throw FormatError(options.points, "", "holds no point");
  if (!others.empty())
    throw UsageError(options.out + " has clicks of camera " + others[0] +
                     ", which is not given: give it too, or another option 'out'");
}

ClickScene ReadClickScene(const ClickOptions& options, InputNotes* notes) {
  if (options.cameras.empty())
    throw UsageError("option 'camera' NAME=PATH is needed at least once, or a option 'session' with footage");
  geometry::Rig lenses;
  if (!options.calib.empty()) {
    const calib::ImportedRig given = ReadCalibrationFiles({options.calib}, {});
    AddNotes(given.notes, notes);
    lenses = given.rig;
    notes->inputs.push_back(options.calib);
  }
  ClickScene scene;
  for (const NamedPath& camera : options.cameras) {
    const int known = lenses.Find(camera.name);
    const auto lens = known < 0 ? std::nullopt : std::optional(lenses.cameras[static_cast<size_t>(known)].camera);
    AddCamera(camera.name, ClickImageOf(camera, options.frame), lens, &scene);
    notes->inputs.push_back(camera.path);
  }
  ReadClickPoints(options, &scene);
  notes->inputs.push_back(options.points);
  return scene;
}

/// What the page asks for; clicks are saved as they come.
class ClickPage {
 public:
  ClickPage(const ClickOptions& options, ClickScene* scene) : options_(options), scene_(scene) {}

  PageAnswer operator()(const PageRequest& request) {
    if (request.method == "POST") return Post(request);
    const std::string& path = request.path;
    if (path.empty()) return {200, "text/html; charset=utf-8", ClickPageHtml()};
    if (path == "click.css") return {200, "text/css; charset=utf-8", ClickPageStyle()};
    if (path == "click.js") return {200, "text/javascript; charset=utf-8", ClickPageScript()};
    if (path == "scene.json") return {200, "application/json", SceneJsonText(*scene_, options_.resection)};
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
    SentClicks sent = ReadSentClicks(request.body, *scene_);
    const bool newest = sent.revision == scene_->revision;  // else another page has saved: what that one saved is the answer
    if (newest) Save(std::move(sent.clicks));
    return {newest ? 200 : 409, "application/json", ClicksJsonText(*scene_, options_.resection)};
  }

  /// The scene holds what the table holds.
  void Save(ClickMap clicks) {
    std::swap(scene_->clicks, clicks);
    try {
      WriteFileAtomic(options_.out, ClicksCsv(*scene_));
    } catch (...) {
      std::swap(scene_->clicks, clicks);
      throw;
    }
    ++scene_->revision;
  }

  const ClickOptions& options_;
  ClickScene* scene_;
  bool is_finished_ = false;
};

std::string WhatIsSaved(const ClickReport& report) {
  const size_t count = report.scene.clicks.size();
  if (!report.is_written) return "no click was made, so " + report.options.out + " was not written";
  return std::to_string(count) + (count == 1 ? " click is in " : " clicks are in ") + report.options.out;
}

}  // namespace

ClickReport RunClick(ClickOptions given, const ShowPage& serve, const RunContext& run) {
  ClickReport report;
  report.options = std::move(given);
  ClickOptions& options = report.options;
  FillClicksFromSession(&options, &report.notes);
  if (options.out.empty()) throw UsageError("option 'out' is required, or a option 'session' to write to");
  std::vector<std::string> inputs;
  for (const NamedPath& camera : options.cameras) inputs.push_back(camera.path);
  inputs.push_back(options.points), inputs.push_back(options.calib);
  const OutputFiles place({options.out}, inputs);
  report.scene = ReadClickScene(options, &report.notes);
  ClickPage page(options, &report.scene);
  const auto interrupted = [&] { return run.progress && run.progress->Cancelled(); };
  serve([&](const PageRequest& request) { return page(request); }, [&] { return page.is_finished() || interrupted(); });
  report.is_written = fs::exists(options.out);
  if (interrupted()) throw CancelledError("interrupted; " + WhatIsSaved(report));
  return report;
}

}  // namespace mvstudio::stages
