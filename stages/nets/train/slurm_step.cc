#include "stages/nets/train/slurm_step.h"

#include <charconv>
#include <cstring>
#include <filesystem>

#include "core/disk/place.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace {

constexpr char kAsked[] = "option 'rendezvous' slurm: ";

class StepVariables {
 public:
  explicit StepVariables(const EnvironmentGetter& get) : get_(get) {}

  bool Has(const char* name) const {
    const char* text = get_(name);
    return text && *text != '\0';
  }
  int Number(const char* name) const {
    if (!Has(name))
      throw UsageError(std::string(kAsked) + name + " is not set; start the command by `srun`, which sets it for each process");
    const char* text = get_(name);
    const char* end = text + std::strlen(text);
    int value = -1;
    const auto read = std::from_chars(text, end, value);
    if (read.ec != std::errc() || read.ptr != end || value < 0)
      throw UsageError(std::string(kAsked) + name + " is '" + text + "', no whole number from 0; `srun` sets it");
    return value;
  }
  int Number(const char* name, int otherwise) const { return Has(name) ? Number(name) : otherwise; }

 private:
  const EnvironmentGetter& get_;
};

}  // namespace

SlurmStep ReadSlurmStep(const EnvironmentGetter& get) {
  const StepVariables variables(get);
  SlurmStep step;
  const int job = variables.Number("SLURM_JOB_ID"), number = variables.Number("SLURM_STEP_ID");
  step.rank = variables.Number("SLURM_PROCID");
  const bool of_step = variables.Has("SLURM_STEP_NUM_TASKS");  // the job may have more
  step.size = variables.Number(of_step ? "SLURM_STEP_NUM_TASKS" : "SLURM_NTASKS");
  step.threads = variables.Number("SLURM_CPUS_PER_TASK", 0);
  step.one_machine = variables.Number("SLURM_STEP_NUM_NODES", 0) == 1;
  step.id =
      std::to_string(job) + "-" + std::to_string(number) + "-" + std::to_string(variables.Number("SLURM_RESTART_COUNT", 0));
  if (step.size < 1 || step.rank >= step.size)
    throw UsageError(std::string(kAsked) + "SLURM_PROCID is " + std::to_string(step.rank) + " of " + std::to_string(step.size) +
                     " processes; `srun` counts them from 0");
  return step;
}

std::string MeetingBeside(const std::string& run_folder, const SlurmStep& step) {
  const std::filesystem::path path = PathOnDisk(run_folder);
  return (path.parent_path() / ("." + path.filename().string() + ".ranks-" + step.id)).string();
}

}  // namespace mvstudio::stages
