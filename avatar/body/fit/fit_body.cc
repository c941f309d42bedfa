#include "avatar/body/fit/fit_body.h"

#include <cmath>
#include <limits>
#include <set>

#include "avatar/body/fit/fit_judge.h"
#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/statistics.h"
#include "core/stopwatch.h"

namespace mvstudio::body {
namespace {

// From stiff and far to soft and near: smoothness of the offsets, reach of the outlines.
struct Round {
  double laplacian_sigma_m, max_px;
};
constexpr Round kRounds[] = {{1e-4, 40}, {2e-4, 30}, {4e-4, 24}, {6e-4, 20}, {1e-3, 16}, {1e-3, 12}};
constexpr double kShapeReachPx[] = {40, 30, 24};
constexpr double kSmoothness[] = {3e-4, 1e-3, 3e-3};  // of which held-out silhouettes choose
constexpr double kReachPx = 12;
constexpr double kBrightnessSigmaPx[] = {4, 2};
constexpr double kOneCameraMargin = 0.1;  // of the held-out loss, by which a softer surface must lower it

// Of the time of a fit, as measured on 30 time steps of six cameras: a round of outlines is 1.
constexpr int kRoundWork = 1, kSmoothnessWork = 2, kBrightnessWork = 4, kFinishWork = 3;
constexpr int kBrightnessParts = 3, kFinishParts = 3;

/// A body that has been fitted so far, and its losses.
struct Candidate {
  std::string name;
  FitState state;
  PersonBody person;
  std::vector<double> loss;
  bool by_brightness = false;
  double smoothness_m = 0;  // of its offsets; 0: none
};

bool SeveralCameras(const std::vector<FitStep>& steps) {
  std::set<std::string> names;
  for (const FitStep& step : steps) {
    for (const FitView& view : step.views) names.insert(view.camera_name);
  }
  return names.size() > 1;
}

class Fit {
 public:
  Fit(const BodyTemplate& body, const std::vector<FitStep>& steps, const BodyFitOptions& options, const RunContext& run)
      : steps_(steps),
        options_(options),
        run_(run),
        several_cameras_(SeveralCameras(steps)),
        state_(body, steps, options, run) {}

  BodyFit Run() {
    if (!state_.HasPoses() || !HasViews()) {
      out_.status = Status::kTooFewViews;
      out_.person = state_.Person();
      return out_;
    }
    ProgressStage stage(run_, "fitting the body", TotalWork());
    before_ = ViewIous(state_, steps_, run_);
    Reject(before_);
    std::vector<Candidate> candidates = {Judge("lengths of the bones alone", state_)};
    out_.iou_before = 1 - Mean(FiniteValues(candidates[0].loss));
    if (options_.fit_surface) FitSurface(&stage, &candidates);
    Candidate best = Choose(&candidates);
    if (UsesBrightness()) {
      const bool bones_alone = best.name == candidates[0].name;
      if (bones_alone) stage.Advance(kBrightnessParts * kBrightnessWork);
      if (!bones_alone) best = WithBrightness(std::move(best), &stage);
    }
    Finish(best, &stage);
    return out_;
  }

 private:
  bool UsesBrightness() const { return options_.fit_surface && options_.use_brightness && several_cameras_; }

  int64_t TotalWork() const {
    int64_t work = kFinishParts * kFinishWork;
    if (options_.fit_surface) work += std::size(kRounds) * kRoundWork + std::size(kSmoothness) * kSmoothnessWork;
    return UsesBrightness() ? work + kBrightnessParts * kBrightnessWork : work;
  }

  bool HasViews() const {
    for (size_t i = 0; i < steps_.size(); ++i) {
      if (state_.IsFitted(static_cast<int>(i)) && !steps_[i].views.empty()) return true;
    }
    return false;
  }

  void Reject(const std::vector<std::vector<double>>& ious) {
    const std::vector<RejectedView> rejected = RejectViews(steps_, ious, state_.used());
    out_.rejected.insert(out_.rejected.end(), rejected.begin(), rejected.end());
  }

  void FitOutlines(ProgressStage* stage) {
    for (const double max_px : kShapeReachPx) {
      if (state_.HasShapes()) state_.FitShapes(max_px), state_.FitPoses(max_px);
    }
    bool first = !state_.HasShapes();
    for (const Round& round : kRounds) {
      state_.FitShape(round.laplacian_sigma_m, round.max_px);
      if (!first) state_.FitPoses(round.max_px);
      first = false;
      stage->Advance(kRoundWork);
    }
    Reject(ViewIous(state_, steps_, run_));
  }

  void FitSurface(ProgressStage* stage, std::vector<Candidate>* candidates) {
    FitOutlines(stage);
    for (const double smoothness : kSmoothness) {
      FitState softer = state_;
      for (int k = 0; k < 2; ++k) softer.FitShape(smoothness, kReachPx), softer.FitPoses(kReachPx);
      candidates->push_back(Judge(Format("offsets, smooth to %.1f mm", 1e3 * smoothness), softer));
      candidates->back().smoothness_m = smoothness;
      stage->Advance(kSmoothnessWork);
    }
  }

  Candidate Judge(const std::string& name, const FitState& state) {
    Candidate candidate{name, state, state.Person(), {}, false, 0};
    candidate.loss = OutlineLoss(candidate.person, steps_, run_);
    const double seconds = watch_.Seconds();
    out_.stages.push_back({name, 1 - Mean(FiniteValues(candidate.loss)), seconds, false});
    return candidate;
  }

  /// The simplest body that held-out silhouettes do not show to be worse.
  Candidate Choose(std::vector<Candidate>* candidates) {
    std::vector<HeldOutCandidate> losses;
    for (const Candidate& candidate : *candidates) losses.push_back({candidate.name, candidate.loss});
    HeldOutRule rule;
    if (!several_cameras_) rule.relative = kOneCameraMargin;
    const HeldOutChoice choice = ChooseHeldOut(losses, rule);
    const int index = choice.status == Status::kOk ? choice.index : 0;  // nobody can say that offsets are better
    out_.stages[index].kept = true;
    return (*candidates)[index];
  }

  /// Poses by brightness too, where the surface of held-out images then fits the others better.
  Candidate WithBrightness(Candidate outlines, ProgressStage* stage) {
    FitState state = outlines.state;
    for (const double sigma_px : kBrightnessSigmaPx) {
      state.FitBrightness(sigma_px, kReachPx);
      state.FitShape(outlines.smoothness_m, kReachPx);
      stage->Advance(kBrightnessWork);
    }
    Candidate brighter = Judge("poses by brightness", state);
    const UnitMean worse = DifferenceOverUnits(BrightnessLoss(brighter.person, steps_, kBrightnessSigmaPx[1], run_),
                                               BrightnessLoss(outlines.person, steps_, kBrightnessSigmaPx[1], run_));
    out_.stages.back().kept = worse.mean < 0;
    brighter.by_brightness = true, brighter.smoothness_m = outlines.smoothness_m;
    stage->Advance(kBrightnessWork);
    return worse.mean < 0 ? brighter : outlines;
  }

  /// Held-out time steps join the others: they have done their work.
  void Finish(const Candidate& best, ProgressStage* stage) {
    out_.held_out_loss = best.loss;
    out_.iou = 1 - Mean(FiniteValues(best.loss));
    FitState state = best.state;
    state.UseAll();
    const std::vector<RejectedView> rejected = RejectViews(steps_, ViewIous(state, steps_, run_), state.used());
    out_.rejected.insert(out_.rejected.end(), rejected.begin(), rejected.end());
    if (!out_.stages[0].kept) {
      for (int k = 0; k < 2; ++k) state.FitPoses(kReachPx);
    }
    stage->Advance(kFinishWork);
    if (best.by_brightness) {
      state.FitBrightness(kBrightnessSigmaPx[1], kReachPx);
      out_.brightness = state.Brightness(kBrightnessSigmaPx[1]);
    }
    stage->Advance(kFinishWork);
    out_.person = state.Person();
    out_.offsets = state.Offsets();
    if (best.smoothness_m > 0) out_.offset_sigma_m = state.OffsetSigma(kReachPx);
    out_.coefficients = state.coefficients();
    out_.joint_error_m = state.joint_error_m();
    out_.cameras = CompareCameras(out_.person, state, steps_, before_, run_);
    stage->Advance(kFinishWork);
  }

  const std::vector<FitStep>& steps_;
  BodyFitOptions options_;
  RunContext run_;
  Stopwatch watch_;
  bool several_cameras_;  // one repeats its own errors in its held-out images: then the surface stays stiffer, without
                          // brightness
  FitState state_;
  BodyFit out_;
  std::vector<std::vector<double>> before_;
};

}  // namespace

void HoldOutViews(std::vector<FitStep>* steps) {
  constexpr size_t kFewestSteps = 10, kFewestViews = 4;
  size_t views = 0, at = 0;
  for (const FitStep& step : *steps) views += step.views.size();
  for (size_t i = 0; i < steps->size(); ++i) {
    const bool block = (i * 20 / steps->size()) % 5 == 2;
    for (FitView& view : (*steps)[i].views) {
      view.held_out = steps->size() >= kFewestSteps ? block : views >= kFewestViews && at % 4 == 1;
      ++at;
    }
  }
}

BodyFit FitBody(const BodyTemplate& body, const std::vector<FitStep>& steps, const BodyFitOptions& options,
                const RunContext& run) {
  return Fit(body, steps, options, run).Run();
}

}  // namespace mvstudio::body
