#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stages/demo/options.h"
#include "stages/demo/truth.h"
#include "stages/pipeline/run.h"

namespace mvstudio::stages {

/// A number of the demo against the bound that it must keep.
struct DemoCheck {
  std::string name, unit;
  double value, bound;
  bool at_least;  ///< the value must be >= bound; otherwise <=
  bool Pass() const { return at_least ? value >= bound : value <= bound; }
};

template <class Visitor>
void VisitFields(Visitor&& visit, const DemoCheck& check) {
  visit("name", check.name);
  visit("value", check.value);
  visit("bound", check.bound);
  visit("unit", check.unit);
  visit("at_least", check.at_least);
  visit("pass", check.Pass());
}

struct DemoReport {
  DemoOptions options;
  std::optional<StudioComparison> truth;  ///< none: a stage failed
  nlohmann::ordered_json scores;          ///< metrics of the avatar's evaluation
  std::vector<DemoCheck> checks;
  std::vector<StageRow> rows;
  std::vector<Notice> warnings, errors;
  int exit = 0;  ///< of the stage that failed
};

struct DemoTools {
  PipelineTools pipeline;
  std::function<void(const DemoReport&)> keep;  ///< keeps the demo's result in its folder, for its page of the report
};

/// Makes the studio's session, does all its stages as `run` does, holds them against the truth, and makes the report. Throws
/// UsageError where something is there already.
DemoReport RunDemo(DemoOptions options, const DemoTools& tools);

}  // namespace mvstudio::stages
