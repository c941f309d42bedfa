#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/pipeline/options.h"

/// A session's stages as tasks for a scheduler: what a caller gives.
namespace mvstudio::stages {

enum class Engine { kNinja, kSlurm, kSnakemake };

inline constexpr ChoiceWords<Engine, 3> kEngineWords = {
    {{Engine::kNinja, "ninja"}, {Engine::kSlurm, "slurm"}, {Engine::kSnakemake, "snakemake"}}};
inline std::string_view ToString(Engine engine) { return WordOf(kEngineWords, engine); }
/// Throws UsageError that lists the words.
void FromString(const std::string& text, Engine* engine);

struct EngineOptions {
  std::string program;   ///< absolute path of mvstudio
  int max_running = 0;   ///< slurm: tasks of one array at a time; 0: no limit
  int max_array = 1000;  ///< slurm: indices of an array, MaxArraySize of slurm.conf less one
  std::string sbatch;    ///< slurm: more options for each sbatch, as a shell reads them
};

template <class Visitor>
void VisitFields(Visitor&& visit, EngineOptions& o) {
  visit("max-running", o.max_running, "slurm: tasks of one array at a time; 0: no limit");
  visit("max-array", o.max_array, "slurm: indices of one array at most, MaxArraySize of slurm.conf less one");
  visit("sbatch", o.sbatch, "slurm: more options for each sbatch");
}

struct PlanOptions {
  PipelineOptions pipeline;
  std::string out;  ///< folder
  std::vector<Engine> write = {Engine::kNinja};
  double task_seconds = 300;  ///< see CutStages; 0: a task is a stage of a take
  EngineOptions engine;
};

struct TaskOptions {
  std::string plan;  ///< folder
  int task = 0;
  bool again = false;  ///< also what is done, and what others made
  bool wait = false;   ///< for another process that does the task now
};

struct JobsOptions {
  std::string plan;  ///< folder
  Engine engine = Engine::kNinja;
  int jobs = 0;  ///< ninja: tasks at a time; 0: its own choice
  EngineOptions limits;
};

}  // namespace mvstudio::stages
