#include "dataset/colour/colour_match.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <set>

#include "core/check.h"
#include "core/choice/heldout_choice.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "dataset/colour/channel_fit.h"
#include "dataset/colour/colour_space.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::dataset {
namespace {

constexpr int kFolds = 4;
constexpr double kLeastImprovement = 0.01;  // of the squared error
constexpr double kStandardErrors = 2;
constexpr double kClipLevels = 3;  // times the best model's median error: larger ones count as much

using Transforms = std::vector<ColourTransform>;

/// The largest set of cameras that hang together by pairs with enough points in common.
std::vector<bool> ConnectedCameras(const std::vector<ColourPoint>& points, int num_cameras, int min_overlap, int reference) {
  Eigen::MatrixXi shared = Eigen::MatrixXi::Zero(num_cameras, num_cameras);
  for (const ColourPoint& point : points) {
    for (const auto& a : point.views) {
      for (const auto& b : point.views) shared(a.camera_idx, b.camera_idx) += a.camera_idx != b.camera_idx;
    }
  }
  std::vector<int> group(num_cameras);
  std::iota(group.begin(), group.end(), 0);
  for (bool changed = true; changed;) {
    changed = false;
    for (int a = 0; a < num_cameras; ++a) {
      for (int b = 0; b < num_cameras; ++b) {
        if (shared(a, b) < min_overlap || group[b] <= group[a]) continue;
        group[b] = group[a], changed = true;
      }
    }
  }
  int best = reference >= 0 ? group[reference] : 0;
  const auto size = [&](int g) { return std::count(group.begin(), group.end(), g); };
  for (int g = 0; reference < 0 && g < num_cameras; ++g) best = size(g) > size(best) ? g : best;
  std::vector<bool> connected(num_cameras, false);
  for (int c = 0; c < num_cameras && size(best) > 1; ++c) connected[c] = group[c] == best;
  return connected;
}

/// Points seen by two or more connected cameras, and by those only.
std::vector<ColourPoint> Usable(const std::vector<ColourPoint>& points, const std::vector<bool>& connected) {
  std::vector<ColourPoint> usable;
  for (const ColourPoint& point : points) {
    ColourPoint kept = point;
    kept.views.clear();
    for (const auto& view : point.views) {
      if (connected[view.camera_idx]) kept.views.push_back(view);
    }
    if (kept.views.size() >= 2) usable.push_back(std::move(kept));
  }
  return usable;
}

/// One channel of the points of all folds but one (-1: of all), cameras renumbered to the connected ones.
std::vector<internal::ChannelPoint> ChannelPoints(const std::vector<ColourPoint>& points, const std::vector<int>& fold,
                                                  int left_out, int channel, ColourSpace space,
                                                  const std::vector<int>& number) {
  std::vector<internal::ChannelPoint> list;
  for (size_t i = 0; i < points.size(); ++i) {
    if (fold[i] == left_out) continue;
    internal::ChannelPoint point;
    double mean = 0;
    for (const auto& view : points[i].views) {
      const double srgb = view.srgb[channel];
      if (!std::isfinite(srgb)) continue;
      mean += srgb;
      point.views.push_back({number[view.camera_idx], internal::ToSpace(srgb, space)});
    }
    if (point.views.size() < 2) continue;
    const double slope =
        space == ColourSpace::kLinear ? internal::LinearSlope(mean / static_cast<double>(point.views.size())) : 1;
    point.weight = 1 / (slope * slope);
    list.push_back(std::move(point));
  }
  return list;
}

/// What all tries share.
struct Problem {
  std::vector<ColourPoint> points;
  std::vector<int> fold;
  std::vector<int> number;  // of a camera among the connected ones, or -1
  int num_connected = 0, num_cameras = 0, reference = -1;
};

/// Gauge of the reference camera: it keeps its own values.
void UseReference(const internal::ChannelFit& fit, int reference, Eigen::VectorXd* gain, Eigen::VectorXd* offset) {
  const double a = fit.response[reference], b = fit.black[reference];
  *offset = a * *offset;
  offset->array() += b;
  *gain *= a;
}

Status FitTransforms(const Problem& problem, ColourModel model, ColourSpace space, int left_out, Transforms* transforms) {
  transforms->assign(problem.num_cameras, {});
  Status status = Status::kOk;
  for (int k = 0; k < 3 && model != ColourModel::kNone; ++k) {
    const internal::ChannelFit fit =
        internal::FitChannel(ChannelPoints(problem.points, problem.fold, left_out, k, space, problem.number),
                             problem.num_connected, model == ColourModel::kGainOffset);
    if (fit.status != Status::kOk) status = fit.status;
    Eigen::VectorXd gain = fit.response.cwiseInverse(), offset = -fit.black.cwiseQuotient(fit.response);
    if (problem.reference >= 0) UseReference(fit, problem.number[problem.reference], &gain, &offset);
    for (int c = 0; c < problem.num_cameras; ++c) {
      if (problem.number[c] < 0) continue;
      (*transforms)[c].gain[k] = gain[problem.number[c]], (*transforms)[c].offset[k] = offset[problem.number[c]];
    }
  }
  return status;
}

/// Distances of a point's corrected colours from their mean, grey levels; nothing of clipped channels.
void Distances(const ColourPoint& point, const Transforms& transforms, ColourSpace space, std::vector<double>* levels) {
  for (int k = 0; k < 3; ++k) {
    double sum = 0;
    std::vector<double> values;
    for (const auto& view : point.views) {
      if (!std::isfinite(view.srgb[k])) continue;
      values.push_back(255 * internal::Corrected(view.srgb[k], transforms[view.camera_idx], k, space));
      sum += values.back();
    }
    const double n = static_cast<double>(values.size());
    for (const double value : values) {
      if (n >= 2) levels->push_back(std::abs(value - sum / n) * n / (n - 1));
    }
  }
}

/// Errors on points held out of the fit.
struct HeldOut {
  std::vector<double> squared;  // by group of points: mean clipped squared distance
  double median_levels = 0;
};

/// Scores transforms fitted without a fold on that fold; groups are frames.
HeldOut Score(const Problem& problem, const std::vector<Transforms>& without_fold, ColourSpace space, double clip) {
  std::map<int, std::pair<double, int64_t>> groups;
  std::vector<double> all;
  for (size_t i = 0; i < problem.points.size(); ++i) {
    std::vector<double> levels;
    Distances(problem.points[i], without_fold[problem.fold[i]], space, &levels);
    auto& [sum, count] = groups[problem.points[i].frame];
    for (const double level : levels) sum += std::min(level, clip) * std::min(level, clip), ++count;
    all.insert(all.end(), levels.begin(), levels.end());
  }
  HeldOut score;
  for (const auto& [frame, group] : groups)
    score.squared.push_back(group.second ? group.first / static_cast<double>(group.second) : 0);
  score.median_levels = UpperMedian(all, 0);
  return score;
}

/// How much of the squared error of `plain` is gone, in parts of it.
UnitMean Improvement(const HeldOut& plain, const HeldOut& score) {
  UnitMean gone = DifferenceOverUnits(plain.squared, score.squared);
  const double usual = Mean(plain.squared);
  if (!(usual > 0)) return {0, 0, gone.num_units};
  gone.mean /= usual, gone.standard_error /= usual;
  return gone;
}

/// A model, tried.
struct Candidate {
  ColourTrial trial;
  HeldOut score;
  std::vector<Transforms> without_fold;
};

Candidate Try(const Problem& problem, ColourModel model, ColourSpace space) {
  Candidate candidate;
  candidate.trial.model = model, candidate.trial.space = space;
  for (int fold = 0; fold < kFolds; ++fold) {
    const Status status = FitTransforms(problem, model, space, fold, &candidate.without_fold.emplace_back());
    if (status != Status::kOk) candidate.trial.status = status;
  }
  return candidate;
}

/// All models on the points held out; errors beyond a few times the best model's usual one count as much as those.
void ScoreAll(const Problem& problem, std::vector<Candidate>* candidates) {
  double best = INFINITY;
  for (Candidate& c : *candidates) {
    c.trial.heldout_levels = Score(problem, c.without_fold, c.trial.space, INFINITY).median_levels;
    best = std::min(best, c.trial.heldout_levels);
  }
  const double clip = kClipLevels * std::max(best, 0.5);
  for (Candidate& c : *candidates) {
    c.score = Score(problem, c.without_fold, c.trial.space, clip);
    const UnitMean gone = Improvement(candidates->front().score, c.score);
    c.trial.heldout_gain = gone.mean, c.trial.heldout_gain_sigma = gone.standard_error;
  }
}

/// Index of the model to use: the simplest that no other beats beyond doubt.
size_t Choose(const std::vector<Candidate>& candidates) {
  HeldOutRule rule;
  rule.standard_errors = kStandardErrors, rule.absolute = kLeastImprovement, rule.min_units = 1;
  size_t best = 0;
  for (const ColourModel model : {ColourModel::kGain, ColourModel::kGainOffset}) {
    size_t challenger = 0;
    for (size_t i = 1; i < candidates.size(); ++i) {
      const ColourTrial& trial = candidates[i].trial;
      if (trial.model != model || trial.status != Status::kOk) continue;
      if (challenger == 0 || trial.heldout_gain > candidates[challenger].trial.heldout_gain) challenger = i;
    }
    if (challenger == 0) continue;
    if (!IsAsGood(Improvement(candidates[best].score, candidates[challenger].score), rule)) best = challenger;
  }
  return best;
}

/// Delete-a-group jackknife over the folds.
void SetSigmas(const std::vector<Transforms>& without_fold, Transforms* transforms) {
  for (size_t c = 0; c < transforms->size(); ++c) {
    Eigen::Array3d mean = Eigen::Array3d::Zero(), sum = Eigen::Array3d::Zero();
    for (const Transforms& t : without_fold) mean += t[c].gain / kFolds;
    for (const Transforms& t : without_fold) sum += (t[c].gain - mean).square();
    (*transforms)[c].gain_sigma = (sum * (kFolds - 1.0) / kFolds).sqrt();
  }
}

std::vector<int> FoldsByFrame(const std::vector<ColourPoint>& points) {
  std::map<int, int> order;
  for (const ColourPoint& point : points) order.emplace(point.frame, 0);
  int next = 0;
  for (auto& [frame, fold] : order) fold = next++ % kFolds;
  std::vector<int> folds;
  for (size_t i = 0; i < points.size(); ++i) {
    folds.push_back(order.size() >= kFolds ? order[points[i].frame] : static_cast<int>(i * kFolds / points.size()));
  }
  return folds;
}

/// Models and spaces to try; the plain one first.
std::vector<std::pair<ColourModel, ColourSpace>> Wanted(const ColourMatchOptions& options) {
  const bool any_model = options.model == ColourModelChoice::kAuto, any_space = options.space == ColourSpaceChoice::kAuto;
  std::vector<ColourModel> models;
  if (any_model || options.model == ColourModelChoice::kGain) models.push_back(ColourModel::kGain);
  if (any_model || options.model == ColourModelChoice::kGainOffset) models.push_back(ColourModel::kGainOffset);
  std::vector<ColourSpace> spaces;
  if (any_space || options.space == ColourSpaceChoice::kLinear) spaces.push_back(ColourSpace::kLinear);
  if (any_space || options.space == ColourSpaceChoice::kSrgb) spaces.push_back(ColourSpace::kSrgb);
  std::vector<std::pair<ColourModel, ColourSpace>> wanted{{ColourModel::kNone, ColourSpace::kSrgb}};
  for (const ColourSpace space : spaces) {
    for (const ColourModel model : models) wanted.emplace_back(model, space);
  }
  return wanted;
}

Problem MakeProblem(const std::vector<ColourPoint>& points, const std::vector<std::string>& names,
                    const ColourMatchOptions& options) {
  Problem problem;
  problem.num_cameras = static_cast<int>(names.size());
  if (!options.reference.empty()) {
    const auto found = std::find(names.begin(), names.end(), options.reference);
    if (found == names.end())
      throw UsageError("colour-reference '" + options.reference + "' is not a camera; there are " + Join(names, ", "));
    problem.reference = static_cast<int>(found - names.begin());
  }
  for (const ColourPoint& point : points) {
    for (const auto& view : point.views) {
      MVS_CHECK(view.camera_idx >= 0 && view.camera_idx < problem.num_cameras, "camera " << view.camera_idx);
    }
  }
  const std::vector<bool> connected = ConnectedCameras(points, problem.num_cameras, options.min_overlap, problem.reference);
  problem.points = Usable(points, connected);
  problem.fold = FoldsByFrame(problem.points);
  for (const bool c : connected) problem.number.push_back(c ? problem.num_connected++ : -1);
  return problem;
}

std::string Reason(const std::vector<Candidate>& candidates, size_t chosen) {
  const double plain = candidates[0].trial.heldout_levels;
  if (chosen == 0) {
    double best = 0;
    for (const Candidate& c : candidates) best = std::max(best, c.trial.heldout_gain);
    return Format(
        "the cameras differ by %.1f grey levels where they see the same point; gains take away %.1f %% of the "
        "squared difference, not enough to matter",
        plain, 100 * best);
  }
  const ColourTrial& trial = candidates[chosen].trial;
  return Format("held-out points agree to %.1f grey levels with %s in %s, to %.1f without", trial.heldout_levels,
                ToString(trial.model).c_str(), trial.space == ColourSpace::kLinear ? "linear light" : "sRGB values", plain);
}

void CountPoints(const Problem& problem, Transforms* transforms) {
  for (const ColourPoint& point : problem.points) {
    for (const auto& view : point.views) ++(*transforms)[view.camera_idx].points;
  }
  for (int c = 0; c < problem.num_cameras; ++c) {
    if (problem.number[c] < 0) (*transforms)[c].status = Status::kTooFewViews;
  }
}

}  // namespace

ColourMatch MatchColours(const std::vector<ColourPoint>& points, const std::vector<std::string>& camera_names,
                         const ColourMatchOptions& options) {
  const auto wanted = Wanted(options);
  const Problem problem = MakeProblem(points, camera_names, options);
  ColourMatch match;
  match.points = static_cast<int>(problem.points.size());
  match.cameras.resize(camera_names.size());
  CountPoints(problem, &match.cameras);
  if (problem.num_connected < 2) {
    match.status = Status::kTooFewViews;
    match.reason = "no two cameras share " + std::to_string(options.min_overlap) + " surface points; colours stay as they are";
    return match;
  }
  std::vector<Candidate> candidates;
  for (const auto& [model, space] : wanted) candidates.push_back(Try(problem, model, space));
  ScoreAll(problem, &candidates);
  for (const Candidate& candidate : candidates) match.trials.push_back(candidate.trial);
  size_t chosen = Choose(candidates);
  if (options.model != ColourModelChoice::kAuto && options.model != ColourModelChoice::kNone) {
    for (size_t i = chosen = 1; i < candidates.size(); ++i) {
      if (candidates[i].trial.heldout_gain > candidates[chosen].trial.heldout_gain) chosen = i;
    }
  }
  const ColourTrial& trial = candidates[chosen].trial;
  Transforms transforms;
  match.status = FitTransforms(problem, trial.model, trial.space, -1, &transforms);
  match.model = trial.model, match.space = trial.space;
  match.reason = Reason(candidates, chosen);
  if (match.status == Status::kOk) {
    SetSigmas(candidates[chosen].without_fold, &transforms);
  } else {
    match.reason =
        (match.status == Status::kDegenerate ? "the colours in view do not determine " : "the fit did not converge for ") +
        ToString(trial.model) + "; colours stay as they are";
    match.model = ColourModel::kNone;
    transforms.assign(problem.num_cameras, {});
  }
  CountPoints(problem, &transforms);
  match.cameras = transforms;
  return match;
}

ColourMatch MatchDatasetColours(const PanopticDataset& dataset, const ColourMatchOptions& options, const RunContext& run) {
  const std::vector<std::string> names = geometry::CameraNames(dataset.rig);
  ColourMatchOptions resolved = options;
  if (!options.reference.empty()) {
    const std::string name = dataset.Resolve(options.reference);
    if (!name.empty()) resolved.reference = name;
  }
  const ImageSource images = [&](int c, int frame) {
    const std::string path = dataset.ImagePath(names[c], frame);
    return std::filesystem::exists(path) ? ReadImage(path) : Image();
  };
  const ImageSource masks = [&](int c, int frame) {
    return std::filesystem::exists(dataset.MaskPath(names[c], frame)) ? dataset.ReadMask(names[c], frame) : Image();
  };
  return MatchColours(SampleSurfaceColours(dataset.rig, dataset.poses, images, masks, resolved, run), names, resolved);
}

}  // namespace mvstudio::dataset
