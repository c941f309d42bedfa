#include "stages/fronts/meter.h"

#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "dataset/session/session.h"
#include "stages/dataset/studio_names.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// One line, however long the reason.
std::string WhyItFailed(const CallOutcome& outcome) {
  if (outcome.result.errors.empty()) return "the command ended with " + std::to_string(outcome.result.exit);
  const Notice& error = outcome.result.errors.front();
  const std::string text = error.text + (error.hint.empty() ? "" : " (" + error.hint + ")");
  return text.substr(0, text.find('\n'));
}

/// Gates that fail leave figures.
bool HasFigures(const CallOutcome& outcome) {
  const int exit = outcome.result.exit;
  return exit == kExitOk || exit == kExitPartial || exit == kExitQualityGate;
}

}  // namespace

void FrontsMeter::MakeStudio(const StudioSize& size, const std::vector<LineOption>& more, const std::string& session) const {
  const LineOption seed{"seed", {std::to_string(run_.seed)}}, threads{"threads", {std::to_string(run_.num_threads)}};
  CommandLine synth = {{"synth"},
                       {{"out", {session}},
                        {"cameras", {std::to_string(size.cameras)}},
                        {"size", {Format("%dx%d", size.width, size.height)}},
                        {"noise-px", {"1"}},
                        {"board-frames", {std::to_string(size.board_frames)}},
                        {"take-frames", {std::to_string(size.take_frames)}},
                        seed,
                        threads}};
  synth.options.insert(synth.options.end(), more.begin(), more.end());
  const CommandLine stages = {{"run", session}, {{"to", {"dataset"}}, seed, threads}};
  for (const CommandLine& line : {synth, stages}) {
    const CallOutcome outcome = Call(line);
    if (!HasFigures(outcome)) throw IoError(session, "`" + line.Text() + "`: " + WhyItFailed(outcome));
  }
}

FrontsMaterial FrontsMeter::MaterialOf(const std::string& folder, const std::string& take_name, bool quick) const {
  const dataset::Session session = dataset::ReadSession(folder);
  const dataset::SessionTake& take = TakeOf(session, take_name);
  const auto there = [](const std::string& path, const std::string& file) {
    return fs::exists(path + file) ? path : std::string();
  };
  FrontsMaterial material;
  material.runs = runs_, material.quick = quick, material.threads = run_.num_threads, material.seed = run_.seed;
  material.session = folder, material.take = take.name;
  material.calibration = CalibrationOf(session);
  material.pose3d = there(TakeFolder(session, "pose3d", take.name), "/points.csv");
  material.dataset = there(TakeFolder(session, "dataset", take.name), "/dataset.json");
  material.truth_masks = there(folder + "/truth/masks/" + take.name, "");
  for (const dataset::SessionFootage& footage : take.footage) material.cameras.push_back(footage.camera);
  for (const auto& [panoptic, name] : StudioNames(material.dataset)) {
    material.held_out = name;
    if (name != material.cameras.front()) break;  // the first often fixes the world
  }
  if (material.held_out.empty()) material.held_out = material.cameras.back();
  return material;
}

FrontWay FrontsMeter::MeasureWay(const PlannedWay& planned) const {
  FrontWay way;
  way.name = planned.name, way.mark = planned.mark, way.command = planned.work.Text();
  const CallOutcome work = Call(planned.work);
  CallOutcome judge;
  const bool judged = HasFigures(work) && !planned.judge.command.empty();
  if (judged) judge = Call(planned.judge);
  if (!HasFigures(work) || (judged && !HasFigures(judge))) {
    way.why_not = WhyItFailed(HasFigures(work) ? judge : work);
    return way;
  }
  way.seconds = work.seconds, way.cpu_s = work.cpu_s, way.peak_rss_mb = work.peak_rss_mb;
  planned.read(work.result, judge.result, &way);
  if (!std::isfinite(way.error)) way.why_not = "nothing was held out of it";
  return way;
}

}  // namespace mvstudio::stages
