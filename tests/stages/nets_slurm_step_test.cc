#include <map>

#include "core/error.h"
#include "stages/nets/train/slurm_step.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using Variables = std::map<std::string, std::string>;

SlurmStep StepOf(const Variables& variables) {
  return ReadSlurmStep([&](const char* name) -> const char* {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  });
}

const Variables kStep = {{"SLURM_JOB_ID", "12"}, {"SLURM_STEP_ID", "0"}, {"SLURM_PROCID", "3"}, {"SLURM_NTASKS", "4"}};

Variables With(const std::string& name, const std::string& value) {
  Variables variables = kStep;
  variables[name] = value;
  return variables;
}

TEST(SlurmStep, IsReadFromWhatSrunSets) {
  const SlurmStep step = StepOf(kStep);
  EXPECT_EQ(step.rank, 3);
  EXPECT_EQ(step.size, 4);
  EXPECT_EQ(step.threads, 0);
  EXPECT_FALSE(step.one_machine) << "the number of nodes is not known";
  EXPECT_EQ(StepOf(With("SLURM_CPUS_PER_TASK", "6")).threads, 6);
  EXPECT_TRUE(StepOf(With("SLURM_STEP_NUM_NODES", "1")).one_machine);
  EXPECT_FALSE(StepOf(With("SLURM_STEP_NUM_NODES", "2")).one_machine);
  EXPECT_EQ(StepOf(With("SLURM_STEP_NUM_TASKS", "8")).size, 8) << "of the step, where the job has others";
}

TEST(SlurmStep, OneThatIsQueuedAgainMeetsElsewhere) {
  EXPECT_EQ(MeetingBeside("/runs/anna", StepOf(kStep)), "/runs/.anna.ranks-12-0-0");
  EXPECT_EQ(MeetingBeside("/runs/anna/", StepOf(With("SLURM_RESTART_COUNT", "2"))), "/runs/.anna.ranks-12-0-2");
  EXPECT_EQ(MeetingBeside("/runs/anna", StepOf(With("SLURM_STEP_ID", "1"))), "/runs/.anna.ranks-12-1-0");
}

TEST(SlurmStep, WhatIsMissingOrNoNumberIsNamed) {
  for (const auto& [name, value] : kStep) {
    Variables variables = kStep;
    variables.erase(name);
    const std::string text = mvstudio::testing::MessageOf<UsageError>([&] { StepOf(variables); });
    EXPECT_THAT(text, HasSubstr(name + " is not set; start the command by `srun`"));
    for (const char* wrong : {"-1", "x", "2x"}) EXPECT_THROW(StepOf(With(name, wrong)), UsageError) << name << " " << wrong;
  }
  EXPECT_THROW(StepOf(With("SLURM_PROCID", "4")), UsageError) << "they count from 0";
  EXPECT_THROW(StepOf(With("SLURM_NTASKS", "0")), UsageError);
}

}  // namespace
}  // namespace mvstudio::stages
