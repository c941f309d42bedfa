#include "triangulate/sync/sync.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/random.h"
#include "core/statistics.h"
#include "triangulate/sync/pair_curves.h"
#include "triangulate/sync/rates.h"
#include "triangulate/sync/refine_offsets.h"

namespace mvstudio::triangulate {
namespace {

using internal::FineSync;
using internal::kSyncBlocks;
using internal::PairCurve;
using Offsets = std::vector<std::optional<int>>;

constexpr int kDraws = 200;
constexpr int kSameFrames = 2;       ///< offsets that differ by no more are one minimum
constexpr double kClearPair = 0.15;  ///< depth of a pair's minimum that has something to say
constexpr double kMinContrast = 0.1;
constexpr double kMinAgreement = 0.95;
constexpr double kMaxPeakRatio = 0.9;
constexpr double kMaxSigmaFrames = 0.5;

void CheckOptions(const PreparedRig& rig, const SyncOptions& o) {
  const auto require = [](bool holds, const std::string& message) {
    if (!holds) throw UsageError(message);
  };
  require(o.max_offset_frames >= 1 && o.max_offset_frames <= 100000, "option 'max-offset-frames' must lie in 1..100000");
  require(o.min_score >= 0 && o.min_score <= 1, "option 'min-score' must lie in 0..1");
  require(o.min_frames >= 5, "option 'min-frames' must be at least 5");
  require(o.min_overlap > 0 && o.min_overlap <= 1, "option 'min-overlap' must lie in 0..1, above 0");
  for (const PreparedCamera& camera : rig.cameras) {
    if (camera.name == o.reference) return;
  }
  require(o.reference.empty(), "option 'reference' " + o.reference + " is no camera of the calibration; there are " +
                                   Join(rig.cameras, ", ", &PreparedCamera::name));
}

int ChooseReference(const PreparedRig& rig, const std::vector<PairCurve>& curves, const SyncOptions& options) {
  std::vector<double> sums(rig.cameras.size(), 0);
  for (const PairCurve& curve : curves) sums[curve.a] += curve.Strength(), sums[curve.b] += curve.Strength();
  int best = 0;
  for (size_t c = 0; c < sums.size(); ++c) {
    if (rig.cameras[c].name == options.reference) return static_cast<int>(c);
    if (sums[c] > sums[static_cast<size_t>(best)]) best = static_cast<int>(c);
  }
  return best;
}

/// Offsets along the tree of the clearest pairs, from the reference; nothing for cameras it does not reach.
Offsets SpanningTree(const std::vector<PairCurve>& curves, size_t num_cameras, int reference_idx) {
  Offsets offsets(num_cameras);
  offsets[static_cast<size_t>(reference_idx)] = 0;
  while (true) {
    const PairCurve* best = nullptr;
    double best_strength = -1;
    for (const PairCurve& curve : curves) {
      if (!curve.usable() || offsets[curve.a].has_value() == offsets[curve.b].has_value()) continue;
      const double strength = curve.Strength();
      if (strength > best_strength) best_strength = strength, best = &curve;
    }
    if (!best) return offsets;
    if (offsets[best->a]) {
      offsets[best->b] = *offsets[best->a] + best->Best();
    } else {
      offsets[best->a] = *offsets[best->b] - best->Best();
    }
  }
}

/// Pairs of one camera with the others' offsets.
struct CameraCurve {
  struct Term {
    const PairCurve* curve;
    int other;  // offset of the other camera
    bool is_a;
  };
  std::vector<Term> terms;

  double Cost(int d, const int* block_weights = nullptr) const {
    double sum = 0;
    for (const Term& term : terms) sum += term.curve->Cost(term.is_a ? term.other - d : d - term.other, block_weights);
    return sum / static_cast<double>(terms.size());
  }
  bool Admissible(int d) const {
    return std::any_of(terms.begin(), terms.end(), [d](const Term& term) {
      const int64_t i = static_cast<int64_t>(term.is_a ? term.other - d : d - term.other) - term.curve->first;
      return i >= 0 && i < static_cast<int64_t>(term.curve->entries.size()) &&
             term.curve->entries[static_cast<size_t>(i)].admissible;
    });
  }
};

CameraCurve CurveOf(int camera_idx, const std::vector<PairCurve>& curves, const Offsets& offsets) {
  CameraCurve of_camera;
  for (const PairCurve& curve : curves) {
    if (!curve.usable() || (curve.a != camera_idx && curve.b != camera_idx)) continue;
    const int other = curve.a == camera_idx ? curve.b : curve.a;
    if (offsets[static_cast<size_t>(other)]) {
      of_camera.terms.push_back({&curve, *offsets[static_cast<size_t>(other)], curve.a == camera_idx});
    }
  }
  return of_camera;
}

int BestOffset(const CameraCurve& curve, const std::vector<int>& candidates, const int* block_weights = nullptr) {
  int best = candidates.front();
  double best_cost = std::numeric_limits<double>::infinity();
  for (const int d : candidates) {
    const double cost = curve.Cost(d, block_weights);
    if (cost < best_cost) best_cost = cost, best = d;
  }
  return best;
}

std::vector<int> Candidates(const CameraCurve& curve, const SyncOptions& options) {
  std::vector<int> candidates;
  for (int d = -options.max_offset_frames; d <= options.max_offset_frames; ++d) {
    if (curve.Admissible(d)) candidates.push_back(d);
  }
  return candidates;
}

/// One camera at a time to its best offset given the others, until nothing moves.
void Descend(const std::vector<PairCurve>& curves, const SyncOptions& options, int reference_idx, Offsets* offsets) {
  constexpr int kMaxSweeps = 20;
  bool moved = true;
  for (int sweep = 0; moved && sweep < kMaxSweeps; ++sweep) {
    moved = false;
    for (size_t c = 0; c < offsets->size(); ++c) {
      if (static_cast<int>(c) == reference_idx || !(*offsets)[c]) continue;
      const CameraCurve curve = CurveOf(static_cast<int>(c), curves, *offsets);
      const std::vector<int> candidates = Candidates(curve, options);
      if (candidates.empty()) continue;
      const int best = BestOffset(curve, candidates);
      moved |= best != *(*offsets)[c];
      (*offsets)[c] = best;
    }
  }
}

double MedianCost(const CameraCurve& curve, const std::vector<int>& candidates) {
  std::vector<double> costs;
  for (const int d : candidates) costs.push_back(curve.Cost(d));
  return UpperMedian(std::move(costs));
}

double Agreement(const CameraCurve& curve, const std::vector<int>& candidates, int best, uint64_t seed) {
  Rng rng(seed);
  int agree = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    int weights[kSyncBlocks] = {};
    for (int k = 0; k < kSyncBlocks; ++k) ++weights[rng.Index(kSyncBlocks)];
    agree += std::abs(BestOffset(curve, candidates, weights) - best) <= 1;
  }
  return static_cast<double>(agree) / kDraws;
}

/// The lowest cost beyond a barrier that is higher than it by a fifth of the best minimum's depth.
void FindRunnerUp(const CameraCurve& curve, const std::vector<int>& candidates, int best, double typical, CameraSync* sync) {
  const double lowest = curve.Cost(best), depth = typical - lowest;
  sync->runner_up_frames = std::nan("");
  if (!(depth > 0)) return;
  const auto at = std::find(candidates.begin(), candidates.end(), best) - candidates.begin();
  const auto consider = [&](std::ptrdiff_t step) {
    double barrier = lowest;
    for (std::ptrdiff_t i = at; i >= 0 && i < static_cast<std::ptrdiff_t>(candidates.size()); i += step) {
      const double cost = curve.Cost(candidates[static_cast<size_t>(i)]);
      barrier = std::max(barrier, cost);
      const double ratio = (typical - cost) / depth;
      if (barrier - cost < 0.2 * depth || ratio <= sync->peak_ratio) continue;
      if (std::abs(candidates[static_cast<size_t>(i)] - best) <= kSameFrames) continue;
      sync->peak_ratio = ratio;
      sync->runner_up_frames = candidates[static_cast<size_t>(i)];
    }
  };
  consider(1), consider(-1);
}

void CountDisagreements(const CameraCurve& curve, int own, CameraSync* sync) {
  sync->num_pairs = static_cast<int>(curve.terms.size());
  for (const CameraCurve::Term& term : curve.terms) {
    if (term.curve->Strength() < kClearPair) continue;
    const int relative = term.is_a ? term.other - own : own - term.other;
    sync->num_pairs_disagree += std::abs(term.curve->Best() - relative) > kSameFrames;
  }
}

void Fail(SyncStatus status, const std::string& why, CameraSync* sync) {
  sync->status = status;
  sync->message = sync->name + ": " + why;
}

/// Is the minimum real, and unique?
void Judge(CameraSync* sync) {
  sync->status = SyncStatus::kOk;
  if (sync->contrast < kMinContrast) {
    Fail(SyncStatus::kNoMotion,
         Format("other offsets fit as well (median cost only %.0f %% above the best)", 100 * sync->contrast), sync);
  } else if (sync->peak_ratio > kMaxPeakRatio) {
    Fail(SyncStatus::kAmbiguous,
         Format("%.0f and %.0f frames fit equally well; is the motion periodic?", static_cast<double>(sync->coarse_frames),
                sync->runner_up_frames),
         sync);
  } else if (sync->agreement < kMinAgreement) {
    const bool other = std::isfinite(sync->runner_up_frames) && sync->peak_ratio > 0.5;
    Fail(other ? SyncStatus::kAmbiguous : SyncStatus::kNoMotion,
         Format("parts of the take prefer other offsets than %.0f frames (only %.0f %% agree)",
                static_cast<double>(sync->coarse_frames), 100 * sync->agreement),
         sync);
  } else if (2 * sync->num_pairs_disagree > sync->num_pairs) {
    Fail(SyncStatus::kInconsistent, "most other cameras contradict it; does the footage belong to this camera and calibration?",
         sync);
  }
}

CameraSync JudgeCamera(int camera_idx, const std::vector<PairCurve>& curves, const Offsets& offsets, bool is_reference,
                       const SyncOptions& options, uint64_t seed, CameraSync sync) {
  const CameraCurve curve = CurveOf(camera_idx, curves, offsets);
  if (!offsets[static_cast<size_t>(camera_idx)] || curve.terms.empty()) {
    Fail(SyncStatus::kTooFewDetections, "too few frames with joints that another camera sees too", &sync);
    return sync;
  }
  sync.coarse_frames = *offsets[static_cast<size_t>(camera_idx)];
  CountDisagreements(curve, sync.coarse_frames, &sync);
  const std::vector<int> candidates = Candidates(curve, options);
  const double typical = MedianCost(curve, candidates), lowest = curve.Cost(sync.coarse_frames);
  sync.contrast = typical / std::max(lowest, 1e-12) - 1;
  if (is_reference) {
    sync.status = SyncStatus::kOk;
    sync.agreement = 1;
    sync.runner_up_frames = std::nan("");
    return sync;
  }
  sync.agreement = Agreement(curve, candidates, sync.coarse_frames, seed);
  FindRunnerUp(curve, candidates, sync.coarse_frames, typical, &sync);
  Judge(&sync);
  return sync;
}

/// Ratios near 1 are drifts: cameras of 59.94 and 60 Hz.
void SetRate(double rate, double drift, double sigma_drift, CameraSync* sync) {
  constexpr double kNearOne = 0.01;
  sync->nominal_rate = std::abs(rate - 1) < kNearOne ? 1 : rate;
  const double excess = sync->nominal_rate / (rate * (1 + drift)) - 1;
  sync->rate_ppm = std::abs(excess) < 1e-12 ? 0 : 1e6 * excess;
  sync->sigma_rate_ppm = 1e6 * sigma_drift;
}

/// `rates`: frames of each camera for a tick of the clock that `fine` counts by.
void AddFine(const FineSync& fine, const std::vector<double>& rates, SyncResult* result) {
  const double reference_rate = rates[static_cast<size_t>(result->reference_idx)];
  result->residual_before_px = fine.residual_before_px;
  result->residual_after_px = fine.residual_after_px;
  result->num_points = fine.num_points;
  for (size_t c = 0; c < result->cameras.size(); ++c) {
    CameraSync& sync = result->cameras[c];
    if (sync.status != SyncStatus::kOk) continue;
    sync.offset_frames = rates[c] * (fine.offset_frames[c] - fine.drift[c] * fine.middle_frame);
    sync.sigma_frames = rates[c] * fine.sigma_frames[c];
    SetRate(rates[c] / reference_rate, fine.drift[c], fine.sigma_drift[c], &sync);
    if (static_cast<int>(c) == result->reference_idx) continue;
    if (!fine.ok) {
      Fail(SyncStatus::kNoMotion, "the fine solution does not settle", &sync);
    } else if (!(fine.sigma_frames[c] < kMaxSigmaFrames)) {
      Fail(SyncStatus::kNoMotion, Format("the motion leaves %.2f frames of uncertainty", sync.sigma_frames), &sync);
    } else if (std::abs(fine.offset_frames[c] - sync.coarse_frames) > kSameFrames + 1) {
      Fail(SyncStatus::kNoMotion,
           Format("the fine solution, %.2f frames, leaves the coarse one, %.0f", fine.offset_frames[c],
                  static_cast<double>(sync.coarse_frames)),
           &sync);
    }
  }
}

void Conclude(SyncResult* result) {
  CameraSync& reference = result->cameras[static_cast<size_t>(result->reference_idx)];
  const bool alone = std::none_of(result->cameras.begin(), result->cameras.end(), [&reference](const CameraSync& each) {
    return &each != &reference && each.status == SyncStatus::kOk;
  });
  result->status = SyncStatus::kOk;
  for (const CameraSync& each : result->cameras) {
    if (result->status == SyncStatus::kOk) result->status = each.status;
  }
  if (alone && reference.status == SyncStatus::kOk) {
    if (result->status == SyncStatus::kOk) result->status = SyncStatus::kTooFewDetections;
    Fail(result->status, "no other camera's offset could be determined", &reference);
  }
}

/// With every camera's frames as often as `rates` say.
SyncResult SynchronizeAt(const PreparedRig& rig, const std::vector<DetectedFrame>& given, const std::vector<double>& rates,
                         const SyncOptions& options, const RunContext& run) {
  std::vector<Clock> clocks;
  for (const double rate : rates) clocks.push_back({0, rate});
  const bool equal = std::all_of(rates.begin(), rates.end(), [](double rate) { return rate == 1; });
  const std::vector<DetectedFrame> timed = equal ? std::vector<DetectedFrame>() : ApplyClocks(given, clocks);
  const std::vector<DetectedFrame>& frames = equal ? given : timed;
  const std::vector<PairCurve> curves = internal::ComputePairCurves(rig, frames, options, run);

  SyncResult result;
  result.residual_before_px = result.residual_after_px = std::nan("");
  result.reference_idx = ChooseReference(rig, curves, options);
  Offsets offsets = SpanningTree(curves, rig.cameras.size(), result.reference_idx);
  Descend(curves, options, result.reference_idx, &offsets);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    CameraSync sync;
    sync.name = rig.cameras[c].name;
    const int camera_idx = static_cast<int>(c);
    result.cameras.push_back(
        JudgeCamera(camera_idx, curves, offsets, camera_idx == result.reference_idx, options, run.seed + c, std::move(sync)));
    if (result.cameras[c].status != SyncStatus::kOk) offsets[c].reset();
  }
  const auto usable = std::count_if(offsets.begin(), offsets.end(), [](const auto& offset) { return offset.has_value(); });
  const double repeats = std::max(1.0, 1 / *std::min_element(rates.begin(), rates.end()));
  if (usable >= 2)
    AddFine(internal::RefineOffsets(rig, frames, offsets, result.reference_idx, repeats, options, run), rates, &result);
  Conclude(&result);
  return result;
}

int64_t NumOk(const SyncResult& result) {
  return std::count_if(result.cameras.begin(), result.cameras.end(),
                       [](const CameraSync& camera) { return camera.status == SyncStatus::kOk; });
}

/// Among so many rates and offsets, one fits a few cameras of a person who stands still by chance: rates have to explain all
/// cameras that see somebody.
bool ExplainsAll(const SyncResult& result) {
  return std::all_of(result.cameras.begin(), result.cameras.end(), [](const CameraSync& camera) {
    return camera.status == SyncStatus::kOk || camera.status == SyncStatus::kTooFewDetections;
  });
}

}  // namespace

std::string_view ToString(SyncStatus status) {
  constexpr std::string_view kNames[] = {"Ok", "TooFewDetections", "NoMotion", "Ambiguous", "Inconsistent"};
  return kNames[static_cast<int>(status)];
}

SyncResult SynchronizeCameras(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const SyncOptions& options,
                              const RunContext& run) {
  MVS_CHECK(!rig.cameras.empty(), "a rig without cameras");
  CheckOptions(rig, options);
  ProgressStage stage(run, "sync", 2);
  SyncResult result = SynchronizeAt(rig, frames, std::vector<double>(rig.cameras.size(), 1), options, run);
  stage.Advance();
  if (result.status != SyncStatus::kOk && options.find_rates && !frames.empty()) {
    const std::vector<double> rates = internal::FindRates(rig, frames, options, run);
    const bool equal = std::all_of(rates.begin(), rates.end(), [](double rate) { return rate == 1; });
    SyncResult other = equal ? result : SynchronizeAt(rig, frames, rates, options, run);
    if (NumOk(other) > NumOk(result) && ExplainsAll(other)) result = std::move(other);
  }
  stage.Advance();
  return result;
}

}  // namespace mvstudio::triangulate
