#include <algorithm>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/text/shell_word.h"
#include "stages/plan/cut.h"
#include "stages/plan/engines.h"
#include "stages/plan/run.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

std::vector<int> AllTasks(const Plan& plan) {
  std::vector<int> ids;
  for (const PlanTask& task : plan.tasks) ids.push_back(task.id);
  return ids;
}

std::vector<const PipelineStage*> StagesOfPlan(const PipelineReport& ahead) {
  std::vector<const PipelineStage*> chosen;
  for (size_t i = 0; i < ahead.rows.size(); ++i) {
    const StageRow& row = ahead.rows[i];
    if (row.state == RowState::kToDo || row.found) chosen.push_back(&ahead.stages[i]);
  }
  return chosen;
}

void RequireAnyNeeded(const PipelineReport& ahead, const std::string& session) {
  const bool any = std::any_of(ahead.rows.begin(), ahead.rows.end(), [](const StageRow& row) {
    return row.state != RowState::kNotAsked && row.state != RowState::kLeftOut;
  });
  if (!any)
    throw UsageError("nothing of this session is asked for: `mvstudio run " + ShellWord(session) +
                     "` with option 'dry-run' says why");
}

}  // namespace

PlanReport WritePlan(PlanOptions options, const PipelineTools& tools) {
  PipelineOptions& pipeline = options.pipeline;
  PlanReport report;
  report.folder = options.out;
  report.session_file = pipeline.session + "/mvstudio.toml";
  if (fs::exists(report.session_file)) pipeline.session = fs::canonical(pipeline.session).string();
  pipeline.dry_run = true;
  const PipelineReport ahead = RunPipeline(pipeline, tools);
  RequireAnyNeeded(ahead, pipeline.session);
  report.warnings = ahead.warnings;
  const std::vector<const PipelineStage*> chosen = StagesOfPlan(ahead);
  const std::string folder = fs::weakly_canonical(fs::absolute(options.out)).string();
  report.plan = PlanOf(pipeline, chosen, ahead.records, CutStages(options, chosen, ahead.records, folder));
  std::vector<std::string> names = {"plan.jsonl"};
  for (const Engine engine : options.write) names.push_back(EngineFile(engine));
  const OutputFolder place(options.out, {report.session_file}, names);
  MakeFolder(options.out);
  report.plan.folder = fs::canonical(options.out).string();
  report.plan.version = tools.version;
  options.engine.program = ProgramPath();
  FilesTogether files;
  const auto write = [&](const std::string& name, const std::string& text) {
    report.outputs.push_back(options.out + "/" + name);
    WriteFileAtomic(report.outputs.back(), text);
  };
  write("plan.jsonl", PlanText(report.plan));
  for (const Engine engine : options.write)
    write(EngineFile(engine), EngineText(engine, report.plan, AllTasks(report.plan), options.engine));
  files.Commit();
  return report;
}

}  // namespace mvstudio::stages
