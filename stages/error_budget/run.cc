#include "stages/error_budget/run.h"

#include <cmath>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "stages/error_budget/read.h"
#include "triangulate/budget/whiten.h"

namespace mvstudio::stages {
namespace {

constexpr char kPageName[] = "error-budget.html";

/// Whitened errors of all takes, by stage.
struct WhitenedErrors {
  std::vector<double> poses, offsets, joints_2d, joints, joints_with_rig;
};

void AppendErrors(const std::vector<double>& more, std::vector<double>* all) {
  all->insert(all->end(), more.begin(), more.end());
}

void AddWhitened(const BudgetInput& input, const RunContext& run, WhitenedErrors* all) {
  for (const double z : triangulate::WhitenedPoses(input.take.rig, input.truth->rig)) all->poses.push_back(z * z);
  AppendErrors(triangulate::WhitenedOffsets(input.take, *input.truth), &all->offsets);
  const triangulate::WhitenedJoints joints = triangulate::WhitenJoints(input.take, *input.truth, run);
  AppendErrors(joints.detected, &all->joints_2d), AppendErrors(joints.without_rig, &all->joints),
      AppendErrors(joints.with_rig, &all->joints_with_rig);
}

std::vector<StageReliability> ReliabilityOf(const WhitenedErrors& all) {
  std::vector<StageReliability> stages;
  const auto add = [&](const char* stage, const std::vector<double>& squared, int dof, const char* why_none) {
    stages.push_back({stage, triangulate::MeasureReliability(squared, dof), squared.empty() ? why_none : ""});
  };
  add("rig poses", all.poses, 1, "the calibration states no covariance");
  add("time offsets", all.offsets, 1, "no sync.json states a sigma");
  add("2D joints", all.joints_2d, 1, "no 2D joint has a true one");
  add("3D joints", all.joints, 3, "no 3D joint has a true one");
  add("3D joints with the rig's covariance", all.joints_with_rig, 3, "the calibration states no covariance");
  return stages;
}

void MeasureAllReliability(const ErrorBudgetOptions& options, const BudgetInput& first, const RunContext& run,
                           ErrorBudgetReport* report) {
  WhitenedErrors all;
  AddWhitened(first, run, &all);
  for (const std::string& session : options.more) {
    ErrorBudgetOptions other;
    other.session.session = session, other.session.allow_outside = options.session.allow_outside;
    other.sigma_px = options.sigma_px, other.min_score = options.min_score, other.max_persons = options.max_persons;
    const BudgetInput input = ReadBudgetInput(other, &report->notes);
    if (!input.truth) throw UsageError("option 'more': " + session + " has no truth");
    AddWhitened(input, run, &all);
  }
  report->reliability = ReliabilityOf(all);
}

}  // namespace

ErrorBudgetReport RunErrorBudget(const ErrorBudgetOptions& options, const RunContext& run) {
  ErrorBudgetReport report;
  const BudgetInput input = ReadBudgetInput(options, &report.notes);
  if (options.reliability && !input.truth)
    throw UsageError("option 'reliability' needs the truth: option 'truth' and option 'truth-calib', or a session of synth");
  if (!options.more.empty() && !options.reliability) throw UsageError("option 'more' belongs to option 'reliability'");
  std::optional<OutputFolder> place;
  if (!input.folder.empty()) place.emplace(input.folder, report.notes.inputs, std::vector<std::string>{kPageName});
  if (options.reliability) {
    MeasureAllReliability(options, input, run, &report);
  } else if (input.truth) {
    report.budget = triangulate::MeasureBudget(input.take, *input.truth, run);
  } else {
    report.stated = triangulate::MeasureStatedBudget(input.take, options.seeds, run);
  }
  if (!place) return report;
  report.folder = input.folder, report.page = input.folder + "/" + kPageName;
  WriteFileAtomic(report.page, ErrorBudgetPage(report));
  return report;
}

}  // namespace mvstudio::stages
