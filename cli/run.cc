#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/stage.h"
#include "stages/pipeline/describe.h"
#include "stages/plan/describe.h"

/// `run`, and the same stages as tasks of a scheduler: `plan`, `task`, `jobs`.
namespace mvstudio::cli {
namespace {

stages::PipelineTools ToolsOf(const CommandContext& context) { return {CallsIn(context), MVSTUDIO_VERSION}; }

void AddPlanFolder(CLI::App* sub, std::string& plan) { AddOption(sub, "plan", plan, "folder of the plan")->required(); }

}  // namespace

void RegisterRun(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::PipelineOptions>();
  CLI::App* sub =
      app.add_subcommand("run", "A session from footage to a scored avatar and its report: what is not up to date is done");
  AddOption(sub, "session", options->session, "the session's folder")->required();
  VisitFields(OptionAdder{sub}, *options);
  registry.Add(sub, "run", [options](CommandContext& context) { return Describe(RunPipeline(*options, ToolsOf(context))); });
}

void RegisterPlan(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::PlanOptions>();
  CLI::App* sub = app.add_subcommand("plan", "The stages of a session as tasks for a scheduler: ninja, Slurm, Snakemake");
  AddOption(sub, "session", options->pipeline.session, "the session's folder")->required();
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "folder of the plan")->required();
  VisitStageChoice(OptionAdder{sub}, options->pipeline);
  AddOption(sub, "--task-seconds", options->task_seconds,
            "pose2d, mask, dataset and verify of a take that are foretold to take more than twice as long are cut by cameras "
            "and time "
            "into tasks of "
            "about this many seconds; 0: a task is a whole stage")
      ->capture_default_str();
  OptionAdder{sub}.StartGroup("Schedulers");
  AddChoices(sub, "--write", options->write, "schedulers to write files for: ninja, slurm, snakemake")->capture_default_str();
  VisitFields(OptionAdder{sub}, options->engine);
  registry.Add(sub, "plan", [options](CommandContext& context) { return Describe(WritePlan(*options, ToolsOf(context))); });
}

void RegisterTask(CLI::App& app, Registry& registry) {
  auto options = std::make_shared<stages::TaskOptions>();
  CLI::App* sub = app.add_subcommand("task", "Do one task of a plan, unless it is done");
  AddPlanFolder(sub, options->plan);
  AddOption(sub, "task", options->task, "number of the task")->required();
  AddFlag(sub, "--again", options->again, "do it again, also what others made");
  AddFlag(sub, "--wait", options->wait, "where another process does it now, wait for that; else it ends with 75");
  registry.Add(sub, "task",
               [options](CommandContext& context) { return Describe(RunTask(*options, ToolsOf(context), context.run)); });
}

void RegisterJobs(CLI::App& app, Registry& registry) {
  CLI::App* jobs = app.add_subcommand("jobs", "Give the tasks of a plan to a scheduler, and see what is done");
  jobs->require_subcommand(1);
  auto options = std::make_shared<stages::JobsOptions>();
  const auto submit = [options](CommandContext& context) { return Describe(SubmitJobs(*options, context.run)); };
  for (const auto& [name, help] : {std::pair("submit", "Give the tasks to a scheduler"),
                                   std::pair("retry", "Give the tasks that have no valid marker to a scheduler again")}) {
    CLI::App* sub = jobs->add_subcommand(name, help);
    AddPlanFolder(sub, options->plan);
    AddChoice(sub, "--engine", options->engine, "ninja: here, until all are done; slurm: sbatch")->capture_default_str();
    AddOption(sub, "--jobs", options->jobs, "ninja: tasks at a time; 0: ninja's own choice")->capture_default_str();
    VisitFields(OptionAdder{sub}, options->limits);
    registry.Add(sub, std::string("jobs ") + name, submit);
  }
  CLI::App* status = jobs->add_subcommand("status", "What is done, by the markers alone");
  AddPlanFolder(status, options->plan);
  registry.Add(status, "jobs status", [options](CommandContext&) { return Describe(stages::JobsStatus(options->plan)); });
}

}  // namespace mvstudio::cli
