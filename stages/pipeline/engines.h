#pragma once

#include <string>
#include <vector>

#include "stages/pipeline/plan.h"

/// Files by which schedulers do the tasks of a plan.
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

/// build.ninja, submit.sh or Snakefile.
std::string EngineFile(Engine engine);

/// The text of that file for the tasks `ids` of the plan, in rising order. Throws UsageError for a path that holds a line
/// break.
std::string EngineText(Engine engine, const Plan& plan, const std::vector<int>& ids, const EngineOptions& options);

}  // namespace mvstudio::stages
