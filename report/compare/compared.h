// Private: the steps of report/compare/comparison.cc.
#pragma once

#include <string>
#include <vector>

#include "report/figures.h"
#include "report/run_data.h"
#include "report/sections.h"

namespace mvstudio::report {

/// The runs in the order that was given, with names that tell them apart.
struct ComparedRuns {
  std::vector<RunData> data;
  std::vector<std::string> names;

  size_t size() const { return data.size(); }
};

/// One command in all runs.
struct ComparedStage {
  std::string command, folder;     ///< the folder of the last run that has it; "" where the command is there once
  std::vector<const Stage*> runs;  ///< of each run; null: not run there
  std::string why_not;  ///< why scores of held-out images of the first and the last are not compared; empty: they are

  bool InBoth() const { return runs.front() && runs.back(); }
};

/// By command and, where a run has a command several times, by folder; in the order of the pipeline.
std::vector<ComparedStage> MatchStages(const ComparedRuns& runs);

/// Why scores of two results of `avatar eval` are not to be compared; empty: they are.
std::string WhyScoresDiffer(const Stage& first, const Stage& last);

/// What became of a figure from the first run to the last.
enum class Change { kWorse, kBetter, kDiffers, kWithin, kEqual, kNotCompared, kOnlyOne };
std::string_view ToString(Change change);

struct ComparedFigure {
  const Figure* figure = nullptr;
  const ComparedStage* stage = nullptr;
  std::string entry;                ///< the camera, where the figure is of one
  std::vector<double> values;       ///< of each run; NaN: not there
  std::vector<double> half_widths;  ///< of each value, 95 %; NaN: not stated
  double half_width = 0;            ///< of the change, 95 %; NaN: a run states no spread
  Change change = Change::kEqual;

  double difference() const { return values.back() - values.front(); }
  std::string Name() const;  ///< "held-out rms", "cam_01: rms"
};

/// All figures that a run has, in the order of the stages.
std::vector<ComparedFigure> CompareFigures(const std::vector<ComparedStage>& stages);

/// A setting or an input that is not the same in all runs.
struct DifferingText {
  std::string command, what;
  std::vector<std::string> texts;  ///< of each run
};
/// Flags that were typed, options of trainings, lenses, methods, versions. Paths, and what changes no number, are left out.
std::vector<DifferingText> DifferingSettings(const std::vector<ComparedStage>& stages);

struct InputComparison {
  std::vector<DifferingText> differing;
  std::vector<std::string> same, other;  ///< commands whose inputs are all equal; and those that share none
};
/// By the digests in provenance.jsonl.
InputComparison CompareInputs(const ComparedRuns& runs, const std::vector<ComparedStage>& stages);

/// One sentence on the most finished result that both runs have, then one for each earlier one.
std::vector<std::string> JudgingSentences(const ComparedRuns& runs, const std::vector<ComparedStage>& stages,
                                          const std::vector<ComparedFigure>& figures);

/// Held-out images of the first and the last run, with a slider between them; empty without shared ones.
std::string ImagePairs(SectionContext* context, const ComparedRuns& runs, const std::vector<ComparedStage>& stages);

/// The main figures of three runs or more as charts; empty for two. Scores of other held-out images than the first run's are
/// left out.
std::string FiguresOverRuns(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures);

/// The parts of the page; without a body where there is nothing to say.
Section FiguresSection(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures, bool for_client);
Section CamerasSection(const ComparedRuns& runs, const std::vector<ComparedFigure>& figures);
Section VerdictsSection(const ComparedRuns& runs, const std::vector<ComparedStage>& stages);
Section DifferencesSection(const ComparedRuns& runs, const std::vector<DifferingText>& settings, const InputComparison& inputs);
Section CostsSection(const ComparedRuns& runs, const std::vector<ComparedStage>& stages);

/// "0.0123 px", "–".
std::string FigureText(const Figure& figure, double value);
/// "+0.0123".
std::string SignedText(double value);

}  // namespace mvstudio::report
