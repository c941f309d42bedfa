// Private: how ways are run, for run.cc, growth.cc.
#pragma once

#include <string>

#include "core/progress.h"
#include "stages/fronts/plan.h"

namespace mvstudio::stages {

/// Of a synthetic studio.
struct StudioSize {
  int cameras = 0, width = 0, height = 0, board_frames = 0, take_frames = 0;
};

/// Runs commands as children.
class FrontsMeter {
 public:
  FrontsMeter(const ChildCall& call, const std::string& runs, const RunContext& run) : call_(call), runs_(runs), run_(run) {}

  const std::string& runs() const { return runs_; }
  /// A studio and what the stages up to the dataset make of it. Throws IoError.
  void MakeStudio(const StudioSize& size, const std::vector<LineOption>& more, const std::string& session) const;
  /// What a session has; `take`: empty for its only one.
  FrontsMaterial MaterialOf(const std::string& session, const std::string& take, bool quick) const;
  FrontWay MeasureWay(const PlannedWay& planned) const;

 private:
  CallOutcome Call(const CommandLine& line) const {
    return call_(line, runs_, [] {});
  }

  const ChildCall& call_;
  const std::string runs_;
  const RunContext& run_;
};

}  // namespace mvstudio::stages
