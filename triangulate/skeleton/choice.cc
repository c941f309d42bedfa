#include "triangulate/skeleton/choice.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/statistics.h"
#include "triangulate/skeleton/window.h"

/// Terms chosen by cameras that were left out.
namespace mvstudio::triangulate::internal {
namespace {

/// Three runs of consecutive frames, or the whole where it is short.
std::vector<Window> ChoiceWindows(const std::vector<Window>& persons, size_t max_frames) {
  constexpr size_t kRuns = 3;
  std::vector<Window> windows;
  for (const Window& person : persons) {
    const size_t count = person.frames.size(), run = max_frames / kRuns;
    if (count <= max_frames) {
      windows.push_back(person);
      continue;
    }
    for (size_t k = 0; k < kRuns; ++k) {
      const size_t first = k * (count - run) / (kRuns - 1);
      windows.push_back(Part(person, first, first + run));
    }
  }
  return windows;
}

/// Everything as it would be without one camera.
struct Fold {
  int camera_idx = 0;
  std::vector<Window> windows;
  std::vector<std::vector<KnownLength>> lengths;  // (windows)
};

/// The detections of the left-out camera, by cell; the same for all trials.
struct Choice {
  std::vector<Window> windows;     // with all cameras
  std::vector<PointLabel> labels;  // of all cells, window by window
  std::vector<Fold> folds;
};

Fold LeaveOut(const PreparedRig& rig, const std::vector<Window>& windows, const Bones& bones, const PointSolver& solve,
              int camera_idx, int num_threads) {
  Fold fold{camera_idx, windows, {}};
  for (Window& window : fold.windows) {
    ParallelFor(static_cast<int64_t>(window.cells.size()), num_threads, [&](int64_t i) {
      Cell& cell = window.cells[static_cast<size_t>(i)];
      cell.observations = WithoutCamera(rig, cell.observations, camera_idx);
      cell.point = solve(cell.observations);
    });
    fold.lengths.push_back(MeasureLengths(window, bones));
  }
  return fold;
}

std::vector<int> ChoiceCameras(const PreparedRig& rig, const std::vector<Window>& windows, size_t max_cameras) {
  std::vector<int64_t> samples(rig.cameras.size(), 0);
  for (const Window& window : windows) {
    for (const Cell& cell : window.cells) {
      for (size_t i = 0; i < cell.observations.size(); ++i) {
        samples[static_cast<size_t>(cell.observations[i].camera_idx)] += IsLeftOutSample(rig, cell.observations, i);
      }
    }
  }
  std::vector<int> cameras, chosen;
  for (size_t c = 0; c < samples.size(); ++c) {
    if (samples[c] > 0) cameras.push_back(static_cast<int>(c));
  }
  const size_t count = std::min(cameras.size(), max_cameras);
  for (size_t k = 0; k < count; ++k) chosen.push_back(cameras[k * cameras.size() / count]);
  return chosen;
}

Choice MakeChoice(const PreparedRig& rig, const std::vector<Window>& persons, const Bones& bones, const PointSolver& solve,
                  const SkeletonRefineOptions& options, const RunContext& run) {
  Choice choice;
  choice.windows = ChoiceWindows(persons, static_cast<size_t>(options.choice_frames));
  for (const Window& window : choice.windows) {
    for (size_t i = 0; i < window.cells.size(); ++i) {
      choice.labels.push_back({window.frames[i / window.num_joints], window.person, static_cast<int>(i % window.num_joints)});
    }
  }
  for (const int camera : ChoiceCameras(rig, choice.windows, static_cast<size_t>(options.choice_cameras))) {
    choice.folds.push_back(LeaveOut(rig, choice.windows, bones, solve, camera, run.num_threads));
  }
  return choice;
}

/// Refines every fold with these terms and predicts what its camera saw.
std::vector<LeftOutSample> Predict(const PreparedRig& rig, const Choice& choice, const Bones& bones, const Terms& terms,
                                   const RunContext& run) {
  constexpr int kIterations = 4;  // from points that are nearly there
  const size_t num_windows = choice.windows.size();
  std::vector<std::vector<LeftOutSample>> parts(choice.folds.size() * num_windows);
  ParallelFor(static_cast<int64_t>(parts.size()), run.num_threads, [&](int64_t task) {
    const size_t k = static_cast<size_t>(task), w = k % num_windows;
    const Fold& fold = choice.folds[k / num_windows];
    const WindowSolution solution = SolveWindow(rig, fold.windows[w], bones, fold.lengths[w], terms, kIterations, run);
    size_t label = 0;
    for (size_t before = 0; before < w; ++before) label += choice.windows[before].cells.size();
    for (size_t i = 0; i < solution.points.size(); ++i, ++label) {
      const auto& observations = choice.windows[w].cells[i].observations;
      for (size_t o = 0; o < observations.size(); ++o) {
        if (observations[o].camera_idx != fold.camera_idx || !IsLeftOutSample(rig, observations, o)) continue;
        parts[k].push_back(PredictLeftOut(rig, observations[o], solution.points[i], label));
      }
    }
  });
  std::vector<LeftOutSample> samples;
  for (const auto& part : parts) samples.insert(samples.end(), part.begin(), part.end());
  return samples;
}

struct TermKind {
  const char* name;
  AutoOnOff wish;
  std::vector<double> weights;
  void (*set)(Terms*, double);
};

bool Better(const PairedDifference& d) {
  return d.num_samples > 0 && d.median_px < 0 && -d.median_px > d.median_error_px &&
         (d.p90_px <= 0 || (std::isfinite(d.p90_error_px) && d.p90_px <= d.p90_error_px));
}

/// The weakest weight (tried from weak to strong) that is as good as the best. It is better than no term, and worse than
/// the best by at most the standard error of their difference.
size_t WeakestAsGood(const std::vector<TermTrial>& trials, const std::vector<std::vector<LeftOutSample>>& samples,
                     const Choice& choice) {
  size_t best = 0;
  for (size_t k = 1; k < trials.size(); ++k) {
    const bool lower = trials[k].after.median_px < trials[best].after.median_px;
    if (trials[k].better != trials[best].better ? trials[k].better : lower) best = k;
  }
  for (size_t k = 0; k < best; ++k) {
    const PairedDifference d = CompareLeftOut(samples[best], samples[k], choice.labels);
    if (trials[k].better && d.median_px <= d.median_error_px) return k;
  }
  return best;
}

/// Tries the weights of one term beside those in `terms`; keeps one where it is wanted or justified.
void TryTerm(const PreparedRig& rig, const Choice& choice, const Bones& bones, const TermKind& kind, const RunContext& run,
             ProgressStage* stage, Terms* terms, std::vector<LeftOutSample>* current, SkeletonRefineReport* report) {
  if (kind.wish == AutoOnOff::kOff) return;
  std::vector<TermTrial> trials;
  std::vector<std::vector<LeftOutSample>> samples;
  for (const double weight : kind.weights) {
    Terms tried = *terms;
    kind.set(&tried, weight);
    samples.push_back(Predict(rig, choice, bones, tried, run));
    stage->Advance();
    TermTrial& trial = trials.emplace_back();
    trial.name = kind.name, trial.weight = weight;
    trial.before = SummarizeLeftOut(rig, *current, choice.labels).all;
    trial.after = SummarizeLeftOut(rig, samples.back(), choice.labels).all;
    trial.difference = CompareLeftOut(*current, samples.back(), choice.labels);
    trial.better = Better(trial.difference);
  }
  const size_t pick = WeakestAsGood(trials, samples, choice);
  trials[pick].chosen = trials[pick].better || kind.wish == AutoOnOff::kOn;
  if (trials[pick].chosen) {
    kind.set(terms, trials[pick].weight);
    *current = std::move(samples[pick]);
  }
  report->trials.insert(report->trials.end(), trials.begin(), trials.end());
}

double MedianSigmas(const std::vector<LeftOutSample>& samples) {
  std::vector<double> distances;
  for (const LeftOutSample& sample : samples) {
    if (sample.status != Status::kOk) continue;
    distances.push_back(std::sqrt(sample.residual_px.dot(sample.covariance_px2.inverse() * sample.residual_px)));
  }
  return UpperMedian(std::move(distances));
}

/// The smallest part of the single points' covariances that keeps the refined ones honest; `refined` receives it.
double SharedError(const std::vector<LeftOutSample>& single, std::vector<LeftOutSample>* refined) {
  constexpr double kHonest = 1.1774;  // median length of a normal vector in the plane
  constexpr double kStep = 0.125;
  const double limit = std::max(kHonest, MedianSigmas(single));
  std::vector<LeftOutSample> tried = *refined;
  double shared = 0;
  while (shared < 1 && MedianSigmas(tried) > limit) {
    shared += kStep;
    for (size_t i = 0; i < tried.size(); ++i) {
      if (single[i].status != Status::kOk || tried[i].status != Status::kOk) continue;
      tried[i].covariance_px2 = (1 - shared) * (*refined)[i].covariance_px2 + shared * single[i].covariance_px2;
      tried[i].sigma_px = std::sqrt(0.5 * tried[i].covariance_px2.trace());
    }
  }
  *refined = std::move(tried);
  return shared;
}

}  // namespace

Terms ChooseTerms(const PreparedRig& rig, const std::vector<Window>& persons, const Bones& bones, const PointSolver& solve,
                  const SkeletonRefineOptions& options, Terms terms, const RunContext& run, SkeletonRefineReport* report) {
  const Choice choice = MakeChoice(rig, persons, bones, solve, options, run);
  const std::vector<TermKind> kinds = {
      {"robust", options.robust, {1}, [](Terms* t, double) { t->robust = true; }},
      {"smoothness", options.smoothness, {1, 0.3, 0.1, 0.03}, [](Terms* t, double w) { t->smoothness = w; }},
      {"bone-lengths", options.bone_lengths, {0.1, 0.03, 0.01, 0.003}, [](Terms* t, double w) { t->bone_lengths = w; }}};
  const std::vector<LeftOutSample> base = Predict(rig, choice, bones, terms, run);
  std::vector<LeftOutSample> current = base;
  report->before = SummarizeLeftOut(rig, base, choice.labels).all;
  int64_t num_trials = 0;
  for (const TermKind& kind : kinds) num_trials += kind.wish == AutoOnOff::kOff ? 0 : static_cast<int64_t>(kind.weights.size());
  ProgressStage stage(run, "choose terms", num_trials);
  for (const TermKind& kind : kinds) TryTerm(rig, choice, bones, kind, run, &stage, &terms, &current, report);
  terms.shared_error = SharedError(base, &current);
  report->shared_error = terms.shared_error;
  report->after = SummarizeLeftOut(rig, current, choice.labels).all;
  report->robust = terms.robust, report->smoothness = terms.smoothness, report->bone_lengths = terms.bone_lengths;
  return terms;
}

}  // namespace mvstudio::triangulate::internal
