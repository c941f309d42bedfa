#include "triangulate/people/sides.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>

#include "core/check.h"
#include "core/parallel.h"
#include "triangulate/people/affinity.h"

namespace mvstudio::triangulate {
namespace {

using internal::Candidate;
using Pairs = std::vector<std::pair<int, int>>;

/// One person in one frame, and the cameras that see it.
struct PersonObservation {
  size_t frame_idx = 0, person = 0;
  std::vector<int> cameras;
};

/// The person's detections; their rays are not kept, as a take has many.
std::vector<Candidate> ViewsOf(const PreparedRig& rig, const DetectedFrame& frame, const std::vector<int>& choice,
                               const AssociationOptions& options) {
  DetectedFrame own{frame.frame, std::vector<std::vector<DetectedPerson>>(frame.people.size())};
  for (size_t c = 0; c < own.people.size(); ++c) {
    if (choice[c] >= 0) own.people[c].push_back(frame.people[c][static_cast<size_t>(choice[c])]);
  }
  std::vector<Candidate> views = internal::MakeCandidates(rig, own, options);
  for (Candidate& view : views) view.person_idx = choice[static_cast<size_t>(view.camera_idx)];
  return views;
}

/// Labels of a observation's views: +1, or -1 for mirrored.
struct Labels {
  Eigen::VectorXd label;
  std::vector<size_t> small, large;  // the two groups, without the views whose label has almost no effect
  bool is_tie = false;
};

std::vector<PersonObservation> CollectObservations(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                                   const std::vector<std::vector<std::vector<int>>>& assignment,
                                                   const AssociationOptions& options, int num_threads) {
  std::vector<std::vector<PersonObservation>> by_frame(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), num_threads, [&](int64_t f) {
    for (size_t p = 0; p < assignment[f].size(); ++p) {
      PersonObservation observation{static_cast<size_t>(f), p, {}};
      for (const Candidate& view : ViewsOf(rig, frames[f], assignment[f][p], options))
        observation.cameras.push_back(view.camera_idx);
      if (observation.cameras.size() >= 2) by_frame[f].push_back(std::move(observation));
    }
  });
  std::vector<PersonObservation> observations;
  for (auto& each : by_frame) std::move(each.begin(), each.end(), std::back_inserter(observations));
  return observations;
}

/// Evidence, in joints, for the current labels over the swapped ones, for each view.
struct SideFit {
  Eigen::MatrixXd gain;  // (groups, views)
  double evidence = 0;   // of all views for the others' points
};

/// The rays of one joint in views whose joints are labelled: l where the label is +1, else r.
class Bundle {
 public:
  Bundle(const std::vector<Candidate>& views, const Eigen::VectorXd& label, int l, int r) : views_(views) {
    for (size_t i = 0; i < views.size(); ++i) {
      joints_.push_back(label[static_cast<Eigen::Index>(i)] > 0 ? l : r);
      if (views[i].is_seen[joints_[i]]) sum_.Add(views[i], joints_[i], 1), seen_.push_back(i);
    }
  }

  /// Evidence that a joint of a view belongs here, from the other views' rays; 0 when there are none.
  double Evidence(size_t view, int joint, double sigma_px) const {
    if (!views_[view].is_seen[joint]) return 0;
    const bool is_in = views_[view].is_seen[joints_[view]];
    const int num_others = sum_.num_rays - is_in;
    if (num_others == 1) {
      const size_t other = seen_[seen_[0] == view ? 1 : 0];
      return internal::RayEvidence(views_[view], joint, views_[other], joints_[other], sigma_px);
    }
    internal::RaySum others = sum_;
    if (is_in) others.Add(views_[view], joints_[view], -1);
    const auto point = internal::Solve(others);
    return point ? internal::PointEvidence(views_[view], joint, *point, sigma_px) : 0;
  }

 private:
  const std::vector<Candidate>& views_;
  std::vector<int> joints_;   // [view]
  std::vector<size_t> seen_;  // views with a ray
  internal::RaySum sum_;
};

SideFit FitLabels(const std::vector<Candidate>& views, const MirrorGroups& groups, const Eigen::VectorXd& label,
                  double sigma_px) {
  SideFit fit{Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(groups.size()), label.size()), 0};
  for (size_t g = 0; g < groups.size(); ++g) {
    for (const auto& [l, r] : groups[g]) {
      const Bundle left(views, label, l, r), right(views, label, r, l);
      for (Eigen::Index i = 0; i < label.size(); ++i) {
        const size_t view = static_cast<size_t>(i);
        const int own_left = label[i] > 0 ? l : r, own_right = label[i] > 0 ? r : l;
        const double as_is = left.Evidence(view, own_left, sigma_px) + right.Evidence(view, own_right, sigma_px);
        const double rotated = left.Evidence(view, own_right, sigma_px) + right.Evidence(view, own_left, sigma_px);
        fit.gain(static_cast<Eigen::Index>(g), i) += as_is - rotated;
        fit.evidence += as_is;
      }
    }
  }
  return fit;
}

/// Turns the view that gains most by it until none does.
SideFit Descend(const std::vector<Candidate>& views, const MirrorGroups& groups, double sigma_px, Eigen::VectorXd* label) {
  constexpr double kWorthIt = 0.5;  // joints
  for (size_t step = 0;; ++step) {
    SideFit fit = FitLabels(views, groups, *label, sigma_px);
    Eigen::Index worst = 0;
    if (step == views.size() || !(fit.gain.colwise().sum().minCoeff(&worst) < -kWorthIt)) return fit;
    (*label)[worst] = -(*label)[worst];
  }
}

double Agreement(const Eigen::MatrixXd& alike, const Eigen::VectorXd& label) { return label.dot(alike * label); }

/// Labels +1 and -1 that agree best with the pairwise evidence for and against equal labels.
Eigen::VectorXd BestLabels(const Eigen::MatrixXd& alike) {
  const Eigen::Index n = alike.rows();
  Eigen::VectorXd best = Eigen::VectorXd::Ones(n);
  double most = Agreement(alike, best);
  for (Eigen::Index start = 0; start < n; ++start) {
    Eigen::VectorXd label(n);
    for (Eigen::Index i = 0; i < n; ++i) label[i] = alike(start, i) < 0 ? -1 : 1;
    bool changed = true;
    while (changed) {
      changed = false;
      for (Eigen::Index i = 0; i < n; ++i) {
        const double pull = alike.row(i).dot(label);
        if (pull * label[i] < -1e-9) label[i] = -label[i], changed = true;
      }
    }
    const double agreement = Agreement(alike, label);
    if (agreement > most + 1e-9) most = agreement, best = label;
  }
  return best;
}

/// Labels of two views each by the rays of pairs alone: the start that no majority is needed for.
Eigen::VectorXd PairwiseLabels(const std::vector<Candidate>& views, const MirrorGroups& groups, double sigma_px) {
  const auto n = static_cast<Eigen::Index>(views.size());
  Eigen::MatrixXd alike = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    for (Eigen::Index b = a + 1; b < n; ++b) {
      const std::vector<Candidate> two = {views[static_cast<size_t>(a)], views[static_cast<size_t>(b)]};
      alike(a, b) = alike(b, a) = FitLabels(two, groups, Eigen::Vector2d::Ones(), sigma_px).gain.sum();
    }
  }
  return BestLabels(alike);
}

/// Labels for the whole body; the smaller group is the mirrored one.
Labels LabelViews(const std::vector<Candidate>& views, const MirrorGroups& groups, double sigma_px, double min_gain_joints) {
  Labels labels;
  labels.label = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(views.size()));
  SideFit fit = Descend(views, groups, sigma_px, &labels.label);
  Eigen::VectorXd other = PairwiseLabels(views, groups, sigma_px);
  const SideFit other_fit = Descend(views, groups, sigma_px, &other);
  if (other_fit.evidence > fit.evidence + 1e-9) labels.label = other, fit = other_fit;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    if (fit.gain.col(column).sum() < min_gain_joints) continue;
    (labels.label[column] < 0 ? labels.small : labels.large).push_back(i);
  }
  if (labels.small.size() > labels.large.size()) std::swap(labels.small, labels.large), labels.label *= -1;
  labels.is_tie = labels.small.size() == labels.large.size() && !labels.small.empty();
  return labels;
}

/// How often each camera was in the smaller group.
struct Rates {
  std::vector<double> swapped, judged;

  explicit Rates(size_t num_cameras) : swapped(num_cameras, 0), judged(num_cameras, 0) {}
  /// Mean over a group.
  double Of(const std::vector<size_t>& party, const PersonObservation& observation) const {
    double sum = 0;
    for (const size_t view : party) {
      const int camera = observation.cameras[view];
      sum += judged[camera] > 0 ? swapped[camera] / judged[camera] : 0;
    }
    return party.empty() ? 0 : sum / static_cast<double>(party.size());
  }
};

/// Settles a tie by the cameras' records: false when they say nothing.
bool SettleTie(const PersonObservation& observation, const Rates& rates, Labels* labels) {
  constexpr double kClear = 0.25;  // difference of two rates of being swapped
  const double small = rates.Of(labels->small, observation), large = rates.Of(labels->large, observation);
  if (std::abs(small - large) < kClear) return false;
  if (large > small) std::swap(labels->small, labels->large), labels->label *= -1;
  return true;
}

/// What is to be done with one view.
struct Verdict {
  bool is_judged = false;
  uint32_t swapped = 0;  // a bit a group
};

/// A group goes with its body unless the other views contradict: by one joint where the body is mirrored, by min_gain_joints
/// where it is not. The view that gains most by turning the group is turned first.
std::vector<Verdict> JudgeViews(const std::vector<Candidate>& views, const MirrorGroups& groups, const Labels& labels,
                                double sigma_px, double min_gain_joints) {
  std::vector<Verdict> verdicts(views.size());
  Eigen::VectorXd body = Eigen::VectorXd::Ones(labels.label.size());
  for (const size_t view : labels.large) verdicts[view].is_judged = true;
  for (const size_t view : labels.small) verdicts[view].is_judged = true, body[static_cast<Eigen::Index>(view)] = -1;
  const Eigen::VectorXd limit = (body.array() < 0).select(Eigen::VectorXd::Ones(body.size()), min_gain_joints);
  for (size_t g = 0; g < groups.size(); ++g) {
    Eigen::VectorXd label = body;
    for (size_t step = 0; step < views.size(); ++step) {
      const Eigen::VectorXd gain = FitLabels(views, {groups[g]}, label, sigma_px).gain.row(0);
      Eigen::Index worst = 0;
      if ((gain + limit).minCoeff(&worst) > 0) break;
      label[worst] = -label[worst];
    }
    for (size_t view = 0; view < views.size(); ++view) {
      if (label[static_cast<Eigen::Index>(view)] < 0) verdicts[view].swapped |= 1u << g, verdicts[view].is_judged = true;
    }
  }
  return verdicts;
}

/// Verdicts on all observations, whose detections `views_of` gives. [observation][view]
std::vector<std::vector<Verdict>> Judge(const std::vector<PersonObservation>& observations,
                                        const std::function<std::vector<Candidate>(const PersonObservation&)>& views_of,
                                        const MirrorGroups& groups, size_t num_cameras, double sigma_px, double min_gain_joints,
                                        int num_threads, int* num_undecided) {
  std::vector<Labels> labels(observations.size());
  std::vector<std::vector<Verdict>> verdicts(observations.size());
  ParallelFor(static_cast<int64_t>(observations.size()), num_threads, [&](int64_t i) {
    const std::vector<Candidate> views = views_of(observations[i]);
    labels[i] = LabelViews(views, groups, sigma_px, min_gain_joints);
    if (!labels[i].is_tie) verdicts[i] = JudgeViews(views, groups, labels[i], sigma_px, min_gain_joints);
  });
  Rates rates(num_cameras);
  for (size_t i = 0; i < labels.size(); ++i) {
    if (labels[i].is_tie) continue;
    for (const size_t view : labels[i].small) ++rates.swapped[observations[i].cameras[view]];
    for (const auto* party : {&labels[i].small, &labels[i].large}) {
      for (const size_t view : *party) ++rates.judged[observations[i].cameras[view]];
    }
  }
  for (size_t i = 0; i < labels.size(); ++i) {
    if (!labels[i].is_tie) continue;
    if (SettleTie(observations[i], rates, &labels[i])) {
      verdicts[i] = JudgeViews(views_of(observations[i]), groups, labels[i], sigma_px, min_gain_joints);
    } else {
      ++*num_undecided;
      verdicts[i].resize(observations[i].cameras.size());
    }
  }
  return verdicts;
}

void CheckGroups(const MirrorGroups& groups, const DetectedPerson& person) {
  const int num_joints = static_cast<int>(person.size());
  for (const Pairs& pairs : groups) {
    for (const auto& [l, r] : pairs) {
      MVS_CHECK(l >= 0 && r >= 0 && l < num_joints && r < num_joints, "pair " << l << ", " << r << " of " << num_joints);
    }
  }
}

/// What was found, also in the report.
std::vector<SwappedView> ToSwaps(const std::vector<PersonObservation>& observations,
                                 const std::vector<std::vector<std::vector<int>>>& assignment,
                                 const std::vector<std::vector<Verdict>>& verdicts, const MirrorGroups& groups,
                                 const std::vector<DetectedFrame>& frames, SideReport* report) {
  const auto all = static_cast<uint32_t>((uint64_t{1} << groups.size()) - 1);
  std::vector<SwappedView> swaps;
  for (size_t i = 0; i < observations.size(); ++i) {
    const auto& [frame_idx, person, cameras] = observations[i];
    for (size_t v = 0; v < cameras.size(); ++v) {
      CameraSides& camera = report->cameras[cameras[v]];
      const Verdict& verdict = verdicts[i][v];
      camera.num_frames += verdict.is_judged;
      if (verdict.swapped == 0) continue;
      swaps.push_back({frame_idx, cameras[v], assignment[frame_idx][person][cameras[v]], verdict.swapped});
      ++camera.num_swapped, camera.num_partly += verdict.swapped != all;
      const int frame = frames[frame_idx].frame;
      if (camera.frames.empty() || camera.frames.back() != frame) camera.frames.push_back(frame);
    }
  }
  return swaps;
}

void Finish(SideReport* report) {
  for (CameraSides& camera : report->cameras) {
    report->num_swapped += camera.num_swapped;
    if (camera.num_swapped == 0) continue;
    camera.message = camera.name + ": left and right swapped in " + std::to_string(camera.num_swapped) + " of " +
                     std::to_string(camera.num_frames) + " frames";
    if (camera.num_partly > 0) camera.message += ", in " + std::to_string(camera.num_partly) + " of them in parts of the body";
  }
}

}  // namespace

std::vector<SwappedView> FindSwaps(const PreparedRig& rig, const std::vector<std::vector<std::vector<int>>>& assignment,
                                   const MirrorGroups& groups, const SideOptions& options, const RunContext& run,
                                   const std::vector<DetectedFrame>& frames, SideReport* report) {
  constexpr size_t kMaxSample = 200;
  MVS_CHECK(assignment.size() == frames.size(), assignment.size() << " frames of " << frames.size());
  MVS_CHECK(groups.size() <= 32, groups.size() << " groups");
  *report = {};
  for (const PreparedCamera& camera : rig.cameras) report->cameras.push_back({camera.name, 0, 0, 0, {}, {}});
  AssociationOptions reading;
  reading.min_score = options.min_score;
  const std::vector<PersonObservation> observations = CollectObservations(rig, frames, assignment, reading, run.num_threads);
  const auto views_of = [&](const PersonObservation& of) {
    return ViewsOf(rig, frames[of.frame_idx], assignment[of.frame_idx][of.person], reading);
  };
  for (const auto& [frame_idx, person, cameras] : observations)
    CheckGroups(groups, frames[frame_idx].people[cameras[0]][assignment[frame_idx][person][cameras[0]]]);
  report->sigma_px = options.sigma_px;
  if (!(report->sigma_px > 0)) {
    std::vector<std::vector<Candidate>> sample;
    const size_t step = std::max<size_t>(1, observations.size() / kMaxSample);
    for (size_t i = 0; i < observations.size(); i += step) sample.push_back(views_of(observations[i]));
    report->sigma_px = internal::AssociationSigma(sample, reading);
  }
  if (!(report->sigma_px > 0)) return {};
  const auto verdicts = Judge(observations, views_of, groups, rig.cameras.size(), report->sigma_px, options.min_gain_joints,
                              run.num_threads, &report->num_undecided);
  std::vector<SwappedView> swaps = ToSwaps(observations, assignment, verdicts, groups, frames, report);
  Finish(report);
  return swaps;
}

void SwapSides(const std::vector<SwappedView>& swaps, const MirrorGroups& groups, std::vector<DetectedFrame>* frames) {
  for (const SwappedView& view : swaps) {
    DetectedPerson& person = (*frames)[view.frame_idx].people[view.camera_idx][view.person_idx];
    for (size_t g = 0; g < groups.size(); ++g) {
      for (const auto& [l, r] : groups[g]) {
        if (view.groups >> g & 1u) std::swap(person[l], person[r]);
      }
    }
  }
}

SideReport FixSides(const PreparedRig& rig, const std::vector<std::vector<std::vector<int>>>& assignment,
                    const MirrorGroups& groups, const SideOptions& options, const RunContext& run,
                    std::vector<DetectedFrame>* frames) {
  SideReport report;
  SwapSides(FindSwaps(rig, assignment, groups, options, run, *frames, &report), groups, frames);
  return report;
}

}  // namespace mvstudio::triangulate
