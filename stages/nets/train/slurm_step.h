#pragma once

#include <functional>
#include <string>

/// The place of this process among those that one `srun` started.
namespace mvstudio::stages {

struct SlurmStep {
  int rank = 0, size = 1;
  int threads = 0;           ///< SLURM_CPUS_PER_TASK; 0: not stated
  bool one_machine = false;  ///< all on one node
  std::string id;            ///< JOB-STEP-RESTARTS: no other step has it, nor the same job when it is queued again
};

/// A variable of the environment; null: not set.
using EnvironmentGetter = std::function<const char*(const char* name)>;

/// From SLURM_PROCID, SLURM_NTASKS, SLURM_JOB_ID, SLURM_STEP_ID and, where they are set, SLURM_STEP_NUM_TASKS,
/// SLURM_STEP_NUM_NODES, SLURM_RESTART_COUNT and SLURM_CPUS_PER_TASK. Throws UsageError that names what is missing or no
/// number: a batch script that does not call `srun` has no step.
SlurmStep ReadSlurmStep(const EnvironmentGetter& get);

/// Where the ranks of `step` find each other: a hidden file beside the run, which all nodes see.
std::string MeetingBeside(const std::string& run_folder, const SlurmStep& step);

}  // namespace mvstudio::stages
