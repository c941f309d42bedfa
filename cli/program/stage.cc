#include "cli/program/stage.h"

#include <sys/resource.h>

#include <cmath>

#include "cli/program/result.h"
#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/process.h"

namespace mvstudio::cli {
namespace {

using StageJson = nlohmann::ordered_json;

std::vector<std::string> After(const std::string& program, const std::vector<std::string>& words) {
  std::vector<std::string> argv = {program};
  argv.insert(argv.end(), words.begin(), words.end());
  return argv;
}

/// Of all children that have been awaited, s.
double ChildrenCpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

LineOutcome RunHere(const std::vector<std::string>& words, const CommandContext& context) {
  GlobalOptions global;
  global.threads = context.run.num_threads;
  global.seed = context.run.seed;
  return RunLine(words, global, [&](const Registry::Entry& entry, CommandContext& stage) {
    stage.run = {context.run.progress, global.threads, global.seed}, stage.argv = After("mvstudio", words);
    return entry.run(stage);
  });
}

LineOutcome RunChild(const std::vector<std::string>& words, const StageOptions& options) {
  ReleaseIdleOutputs();
  const ScratchFolder scratch(options.folder);
  std::vector<std::string> line = After(kThisProgram, words);
  line.push_back("--json");
  const std::string out = scratch.path() + "/out";
  LineOutcome outcome;
  outcome.result.exit = RunProcess(line, {out, scratch.path() + "/err"}, options.poll);
  const std::string text = ReadFile(out);
  if (text.empty() && outcome.result.exit != kExitOk) return outcome;
  outcome.json = StageJson::parse(text, nullptr, false);
  if (!outcome.json.is_object()) throw FormatError(out, "", "is no result of mvstudio");
  outcome.command = outcome.json.value("command", "");
  outcome.result = ResultFromJson(outcome.json, outcome.result.exit);
  return outcome;
}

stages::CallOutcome OutcomeOf(LineOutcome outcome) {
  const auto number = [&](const char* key) {
    const StageJson* timing = outcome.json.is_object() && outcome.json.contains("timing") ? &outcome.json["timing"] : nullptr;
    return timing && timing->contains(key) && (*timing)[key].is_number() ? (*timing)[key].get<double>() : NAN;
  };
  stages::CallOutcome called;
  called.seconds = number("wall_s"), called.peak_rss_mb = number("peak_rss_mb");
  called.result = std::move(outcome.result);
  return called;
}

}  // namespace

LineOutcome RunStage(const std::vector<std::string>& words, const CommandContext& context, const StageOptions& options) {
  return options.mode == StageMode::kHere ? RunHere(words, context) : RunChild(words, options);
}

stages::StageCall CallsIn(const CommandContext& context) {
  return [&context](const stages::CommandLine& line) { return OutcomeOf(RunStage(line.Words(), context)); };
}

stages::ChildCall ChildCallsIn(const CommandContext& context) {
  return [&context](const stages::CommandLine& line, const std::string& folder, const std::function<void()>& poll) {
    const double before_s = ChildrenCpuSeconds();
    stages::CallOutcome outcome = OutcomeOf(RunStage(line.Words(), context, {StageMode::kChild, folder, poll}));
    outcome.cpu_s = ChildrenCpuSeconds() - before_s;
    return outcome;
  };
}

}  // namespace mvstudio::cli
