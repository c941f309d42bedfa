#include "stages/plan/engines.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "core/process.h"
#include "core/text/shell_word.h"

namespace mvstudio::stages {
namespace {

constexpr double kMemoryMargin = 2;  // a task that needs more than it asked for is killed

std::string ForNinja(const std::string& path) {
  std::string escaped;
  for (const char c : path) {
    if (c == '$' || c == ' ' || c == ':') escaped += '$';
    escaped += c;
  }
  return escaped;
}

/// A value of a variable: blanks and colons stand for themselves.
std::string InNinja(const std::string& value) {
  std::string escaped;
  for (const char c : value) escaped += c == '$' ? std::string("$$") : std::string(1, c);
  return escaped;
}

std::string ForPython(const std::string& text) { return nlohmann::json(text).dump(); }

std::string TaskCommand(const Plan& plan, const EngineOptions& options) {
  return ShellWord(options.program) + " task " + ShellWord(plan.folder) + " ";
}

/// Files of a task that no task makes and that ninja can look at.
std::vector<std::string> FilesBefore(const PlanTask& task) {
  std::vector<std::string> files;
  for (const Fingerprint& input : task.inputs)
    if (input.files > 0 && !IsPattern(input.path)) files.push_back(input.path);
  return files;
}

std::string NinjaText(const Plan& plan, const std::vector<int>& ids, const EngineOptions& options) {
  std::string text = "# Written by mvstudio plan: ninja -f " + plan.folder +
                     "/build.ninja -k 0\nninja_required_version = 1.5\nbuilddir = " + ForNinja(plan.folder) +
                     "/ninja\n\nrule task\n  command = " + InNinja(TaskCommand(plan, options)) +
                     "$id\n  description = $what\n  restat = 1\n\n";
  for (const int id : ids) {
    const PlanTask& task = TaskOf(plan, id);
    text += "build " + ForNinja(MarkerPath(plan, task)) + ": task";
    for (const int earlier : task.after)
      if (std::binary_search(ids.begin(), ids.end(), earlier)) text += " " + ForNinja(MarkerPath(plan, TaskOf(plan, earlier)));
    const std::vector<std::string> files = FilesBefore(task);
    if (!files.empty()) text += " |";
    for (const std::string& file : files) text += " " + ForNinja(file);
    text += "\n  id = " + std::to_string(id) + "\n  what = " + InNinja(task.stage.name()) + "\n";
  }
  return text;
}

std::string SnakemakeText(const Plan& plan, const std::vector<int>& ids, const EngineOptions& options) {
  std::string command = TaskCommand(plan, options), braces;
  for (const char c : command) braces += (c == '{' || c == '}') ? std::string(2, c) : std::string(1, c);
  std::string all, rules;
  for (const int id : ids) {
    const PlanTask& task = TaskOf(plan, id);
    std::vector<std::string> before;
    for (const int earlier : task.after)
      if (std::binary_search(ids.begin(), ids.end(), earlier))
        before.push_back(ForPython(MarkerPath(plan, TaskOf(plan, earlier))));
    for (const std::string& file : FilesBefore(task)) before.push_back(ForPython(file));
    all += "        " + ForPython(MarkerPath(plan, task)) + ",\n";
    rules += "\nrule task_" + std::to_string(id) + ":  # " + task.stage.name() + "\n    input: " + Join(before, ", ") +
             "\n    output: " + ForPython(MarkerPath(plan, task)) + "\n    shell: " + ForPython(braces + std::to_string(id)) +
             "\n";
  }
  return "# Written by mvstudio plan: snakemake -s " + plan.folder + "/Snakefile -c 2 --keep-going\nrule all:\n    input:\n" +
         all + rules;
}

/// "3-5,9"
std::string Indices(const std::vector<int>& sorted) {
  std::vector<std::string> parts;
  for (size_t i = 0; i < sorted.size();) {
    size_t end = i;
    while (end + 1 < sorted.size() && sorted[end + 1] == sorted[end] + 1) ++end;
    parts.push_back(std::to_string(sorted[i]) + (end > i ? "-" + std::to_string(sorted[end]) : ""));
    i = end + 1;
  }
  return Join(parts, ",");
}

/// Tasks of one kind of stage that one array can hold: its indices begin at 0.
struct JobArray {
  int first = 0;  ///< task of index 0
  std::string name;
  std::vector<int> ids;
  bool reports = false;
};

std::vector<JobArray> ArraysOf(const Plan& plan, const std::vector<int>& ids, int max_array) {
  std::vector<JobArray> arrays;
  for (const int id : ids) {
    const PlanTask& task = TaskOf(plan, id);
    const std::string part = task.stage.part.substr(0, task.stage.part.find('='));
    const std::string name = std::string(ToString(task.stage.kind)) + (part.empty() ? "" : "-" + part);
    if (arrays.empty() || arrays.back().name != name || id - arrays.back().first >= max_array)
      arrays.push_back({id, name, {}, task.stage.kind == StageKind::kReport});
    arrays.back().ids.push_back(id);
  }
  return arrays;
}

/// "$job1:$job2": the arrays before `at` that hold a task which one of its tasks waits for.
std::string JobsBefore(const Plan& plan, const std::vector<JobArray>& arrays, size_t at) {
  std::vector<std::string> jobs;
  for (size_t k = 0; k < at; ++k) {
    const auto waits_for = [&](int id) {
      const std::vector<int>& after = TaskOf(plan, id).after;
      return std::any_of(after.begin(), after.end(),
                         [&](int earlier) { return std::binary_search(arrays[k].ids.begin(), arrays[k].ids.end(), earlier); });
    };
    if (std::any_of(arrays[at].ids.begin(), arrays[at].ids.end(), waits_for)) jobs.push_back("$job" + std::to_string(k + 1));
  }
  return Join(jobs, ":");
}

/// " --mem=…", twice what the neediest task of the array is foretold to need, rounded up to 100 MiB; empty where one is not
/// known.
std::string MemoryOf(const Plan& plan, const std::vector<int>& ids) {
  double most_mb = 0;
  for (const int id : ids) {
    const double memory_mb = TaskOf(plan, id).stage.need.memory_mb;
    if (!std::isfinite(memory_mb)) return "";
    most_mb = std::max(most_mb, memory_mb);
  }
  return " --mem=" + std::to_string(100 * static_cast<int64_t>(std::ceil(kMemoryMargin * most_mb / 100))) + "M";
}

std::string SlurmText(const Plan& plan, const std::vector<int>& ids, const EngineOptions& options) {
  const std::vector<JobArray> arrays = ArraysOf(plan, ids, options.max_array);
  std::string text =
      "#!/bin/sh\n# Written by mvstudio plan: an array for each stage. Prints the ids of the jobs.\nset -e\nmkdir -p " +
      ShellWord(plan.folder + "/log") + "\n";
  for (size_t k = 0; k < arrays.size(); ++k) {
    const JobArray& array = arrays[k];
    std::vector<int> indices;
    for (const int id : array.ids) indices.push_back(id - array.first);
    const std::string before = JobsBefore(plan, arrays, k);
    const std::string limit = options.max_running > 0 ? "%" + std::to_string(options.max_running) : "";
    const std::string command =
        "exec " + TaskCommand(plan, options) + "$((" + std::to_string(array.first) + " + SLURM_ARRAY_TASK_ID)) --wait";
    text += "job" + std::to_string(k + 1) + "=$(sbatch --parsable --requeue --open-mode=append --job-name=" + array.name +
            " --array=" + Indices(indices) + limit + " --output=" + ShellWord(plan.folder + "/log/%x-%A_%a.txt");
    if (!before.empty()) {
      text += std::string(" --kill-on-invalid-dep=yes --dependency=") + (array.reports ? "afterany:" : "afterok:") + before;
    }
    text += MemoryOf(plan, array.ids);
    if (!options.sbatch.empty()) text += " " + options.sbatch;
    text += " --wrap " + ShellWord(command) + ")\necho \"" + array.name + " $job" + std::to_string(k + 1) + "\"\n";
  }
  return text;
}

}  // namespace

void FromString(const std::string& text, Engine* engine) {
  *engine = KnownChoice(kEngineWords, text, "engine " + text + ": expected ninja, slurm or snakemake");
}

std::string ProgramPath() { return std::filesystem::read_symlink(kThisProgram).string(); }

std::string EngineFile(Engine engine) {
  return engine == Engine::kNinja ? "build.ninja" : engine == Engine::kSlurm ? "submit.sh" : "Snakefile";
}

std::string EngineText(Engine engine, const Plan& plan, const std::vector<int>& ids, const EngineOptions& options) {
  MVS_CHECK(std::is_sorted(ids.begin(), ids.end()), "tasks in rising order");
  for (const PlanTask& task : plan.tasks) {
    std::vector<std::string> paths = {task.stage.output, plan.folder};
    paths.insert(paths.end(), task.stage.inputs.begin(), task.stage.inputs.end());
    for (const std::string& path : paths)
      if (path.find('\n') != std::string::npos)
        throw UsageError("a path with a line break cannot be written for " + std::string(ToString(engine)));
  }
  if (options.max_array < 1)
    throw UsageError("option 'max-array' " + std::to_string(options.max_array) + ": an array holds at least 1 task");
  if (engine == Engine::kNinja) return NinjaText(plan, ids, options);
  return engine == Engine::kSlurm ? SlurmText(plan, ids, options) : SnakemakeText(plan, ids, options);
}

}  // namespace mvstudio::stages
