#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/lens/resection.h"
#include "calib/pipeline/calibrate_steps.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::LensModel;
using geometry::Rigid3;

constexpr double kSameKind = 1.25;  // ratio of focal lengths up to which cameras may have one lens model

/// Cameras that are judged together, and what is assumed of their lenses.
struct Kind {
  std::vector<int> cameras;
  LensPool pool;
  LensChoice choice;
  bool forced_sharing = false;
  bool assumed = false;  ///< one camera whose lens the boards do not determine by themselves
};

int CameraIndex(const std::vector<CameraInput>& cameras, const std::string& name, const std::string& option) {
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (cameras[c].name == name) return static_cast<int>(c);
  }
  throw UsageError(option + ": there is no camera called '" + name + "'");
}

/// Group number of each camera in `groups`, -1 for those not named.
std::vector<int> GroupsOf(const LensSharing& sharing, const std::vector<CameraInput>& cameras) {
  const std::string option = "option 'share-intrinsics' " + ToString(sharing);
  std::vector<int> group(cameras.size(), sharing.kind == LensSharing::Kind::kAll ? 0 : -1);
  for (size_t g = 0; g < sharing.groups.size(); ++g) {
    for (const std::string& name : sharing.groups[g]) {
      const int camera = CameraIndex(cameras, name, option);
      if (group[camera] >= 0) throw UsageError(option + ": camera " + name + " occurs twice");
      group[camera] = static_cast<int>(g);
    }
  }
  return group;
}

bool SameSize(const geometry::Camera& a, const geometry::Camera& b) {
  return a.width_px == b.width_px && a.height_px == b.height_px;
}

bool SameKind(const geometry::Camera& a, const geometry::Camera& b) {
  const double ratio = a.fx() / b.fx();
  return SameSize(a, b) && geometry::IsWide(a.model) == geometry::IsWide(b.model) && ratio < kSameKind && ratio > 1 / kSameKind;
}

std::vector<Kind> FindKinds(const CalibrateInput& input, const CalibrateOptions& options, const std::vector<bool>& fixed,
                            const Work& work) {
  std::vector<int> groups = GroupsOf(options.share_intrinsics, input.cameras);
  int next_group = static_cast<int>(input.cameras.size());
  for (const std::vector<int>& known : input.same_lens) {
    for (int camera : known) groups[camera] = groups[camera] < 0 ? next_group : groups[camera];
    ++next_group;
  }
  std::vector<Kind> kinds;
  std::vector<bool> done(work.monos.size(), false);
  for (size_t a = 0; a < work.monos.size(); ++a) {
    if (done[a]) continue;
    Kind kind;
    kind.forced_sharing = groups[a] >= 0;
    kind.assumed = !kind.forced_sharing && work.lens_step[a].assume_centre;
    const geometry::Camera& first = work.monos[a].state.cameras[0];
    for (size_t b = a; b < work.monos.size(); ++b) {
      const geometry::Camera& other = work.monos[b].state.cameras[0];
      if (done[b] || fixed[a] != fixed[b] || groups[a] != groups[b]) continue;
      if (a != b && !kind.forced_sharing && (kind.assumed || work.lens_step[b].assume_centre)) continue;
      if (kind.forced_sharing && !SameSize(first, other))
        throw UsageError("option 'share-intrinsics': cameras " + first.name + " and " + other.name +
                         " have images of different sizes");
      if (!kind.forced_sharing && !SameKind(first, other)) continue;
      kind.cameras.push_back(static_cast<int>(b));
      done[b] = true;
    }
    kinds.push_back(std::move(kind));
  }
  return kinds;
}

/// A camera from a given calibration.
const geometry::RigCamera* Given(const CalibrateInput& input, const std::string& name) {
  const int index = input.start ? input.start->Find(name) : -1;
  return index < 0 ? nullptr : &input.start->cameras[index];
}

MonoSolution SolveMono(const CalibrateInput& input, const CalibrateOptions& options, const CameraInput& camera,
                       const std::vector<View>& views, bool fixed) {
  BundleOptions bundle = options.bundle;
  bundle.num_threads = 1;
  if (const geometry::RigCamera* given = Given(input, camera.name)) {
    bundle.refine_intrinsics = !fixed;
    return RefineMono(given->camera, views, bundle);
  }
  const geometry::Camera start = geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, camera.width_px);
  const auto model = options.model;
  const bool keep = model && *model != LensModel::kSplined;
  return CalibrateMono(WithModel(start, keep ? *model : LensModel::kBrown4), views, bundle, keep);
}

bool Solved(Status status) { return status == Status::kOk || status == Status::kNotConverged; }

/// A camera that has no solution by itself gets one under the first simpler lens, or assumption, that gives one: what the other
/// cameras know of the boards may do the rest.
bool StartSimpler(const CalibrateInput& input, const CalibrateOptions& options, int camera, Work* work) {
  if (!MaySimplify(input, options, *work, camera) || work->view_ids[camera].empty()) return false;
  std::vector<View> views;
  for (int v : work->view_ids[camera]) views.push_back(work->views[v]);
  for (auto step = NextSimpler({LensModel::kBrown4, {}, false, false}); step; step = NextSimpler(*step)) {
    MonoSolution mono = SolveUnder(input.cameras[camera], *step, views, options.bundle);
    if (!Solved(mono.status)) continue;
    work->monos[camera] = std::move(mono);
    work->lens_step[camera] = *step;
    return true;
  }
  return false;
}

bool SolveMonos(const CalibrateInput& input, const CalibrateOptions& options, const std::vector<bool>& fixed,
                const RunContext& run, Work* work, CalibrateReport* report) {
  work->monos.resize(input.cameras.size());
  work->lens_step.resize(input.cameras.size());
  work->alone_failed.resize(input.cameras.size());
  work->view_ids.assign(input.cameras.size(), {});
  for (size_t v = 0; v < work->views.size(); ++v) work->view_ids[work->views[v].camera_idx].push_back(static_cast<int>(v));
  ParallelFor(static_cast<int64_t>(input.cameras.size()), run.num_threads, [&](int64_t c) {
    std::vector<View> views;
    for (int v : work->view_ids[c]) views.push_back(work->views[v]);
    work->monos[c] = SolveMono(input, options, input.cameras[c], views, fixed[c]);
  });
  for (size_t c = 0; c < work->monos.size(); ++c) {
    if (Solved(work->monos[c].status)) continue;
    const std::string why = work->monos[c].message;
    const Status status = work->monos[c].status;
    work->alone_failed[c] = why;
    if (StartSimpler(input, options, static_cast<int>(c), work)) continue;
    if (report->suspects.empty()) Stop(status, why, report);
    report->suspects.push_back(static_cast<int>(c));
  }
  return report->suspects.empty();
}

/// What a kind of cameras is to be judged on.
SelectionOptions SelectionFor(const CalibrateInput& input, const CalibrateOptions& options, const Kind& kind, bool fixed) {
  SelectionOptions selection;
  selection.folds = std::max(3, options.holdout_folds);
  selection.max_views = options.holdout_views;
  selection.sharing = (options.share_intrinsics.kind == LensSharing::Kind::kAuto && !fixed) || kind.forced_sharing;
  selection.separate = !kind.forced_sharing;
  selection.need_px = options.need_px;
  const geometry::Camera& first = kind.pool.state.cameras[0];
  const auto model = options.model;
  if (fixed || Given(input, first.name)) {
    selection.models = {{first.model, first.spline, false, false}};
  } else if (model) {
    selection.models = {{*model, {}, false, false}};
    if (*model == LensModel::kSplined) selection.models = SplinedConfigs(kind.pool);
  }
  return selection;
}

/// Held-out figures of one camera, and its rows of the table.
void ReportKind(const Kind& kind, CalibrateReport* report) {
  for (size_t k = 0; k < kind.cameras.size(); ++k) {
    CameraReport& camera = report->cameras[kind.cameras[k]];
    camera.model_reason = kind.choice.reason;
    camera.lens_beyond = kind.choice.beyond;
    camera.holdout_rms_px = camera.holdout_median_px = camera.holdout_gross_fraction = std::numeric_limits<double>::quiet_NaN();
    for (size_t i = 0; i < kind.choice.candidates.size(); ++i) {
      const LensCandidate& candidate = kind.choice.candidates[i];
      const HoldoutSummary s = Summarize(candidate.fit, candidate.holdout, static_cast<int>(k));
      const bool chosen = static_cast<int>(i) == kind.choice.index;
      LensConfig one = candidate.config;
      one.shared = false;
      report->selection.push_back({kind.pool.state.cameras[k].name, ToString(candidate.config), NumLensParams(one, 1), s.rms_px,
                                   s.median_px, s.gross_fraction, chosen});
      if (!chosen) continue;
      camera.holdout_rms_px = s.rms_px;
      camera.holdout_median_px = s.median_px;
      camera.holdout_gross_fraction = s.gross_fraction;
    }
  }
}

/// What the boards are allowed to be besides flat and square.
struct BoardShape {
  bool bent = false, stretched = false;
  bool plain() const { return !bent && !stretched; }
};

/// A camera whose lens is partly assumed: that lens, adjusted to its boards.
void FitAssumed(const Work& work, const BoardShape& shape, BundleOptions bundle, Kind* kind) {
  const int camera = kind->cameras[0];
  const LensStep& step = work.lens_step[camera];
  bundle.lens_prior = {PriorOf(step, kind->pool.state.cameras[0], SigmaOf(work.monos[camera]))};
  kind->pool = FitPool(kind->pool, {step.model, step.spline, false, shape.bent, shape.stretched}, bundle);
  kind->choice.reason = ToString(step, kind->pool.state.cameras[0]);
}

/// Configurations worth testing again with warped boards.
std::vector<LensConfig> Promising(const LensChoice& choice) {
  constexpr double kWorthwhile = 1.3;
  double best = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : choice.candidates) best = std::min(best, candidate.relative_error);
  std::vector<LensConfig> configs;
  for (const LensCandidate& candidate : choice.candidates) {
    if (candidate.relative_error <= kWorthwhile * best) configs.push_back(candidate.config);
  }
  return configs;
}

/// The first simpler lens that has a solution, where the one chosen has none.
void FitSimpler(const BundleOptions& bundle, Kind* kind) {
  const LensPool start = kind->pool;
  for (auto step = NextSimpler({start.config.model, start.config.spline, false, false}); step && !Solved(kind->pool.status);
       step = NextSimpler(*step)) {
    if (step->assume_centre) return;
    LensConfig config = start.config;
    config.model = step->model, config.spline = step->spline;
    kind->pool = FitPool(start, config, bundle);
    kind->choice.reason = ToString(config) + ": richer lenses have no solution";
  }
}

void JudgeKind(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, const BoardShape& shape,
               const RunContext& run, Kind* kind) {
  const bool fixed = work.bundle.fix_lens[kind->cameras[0]];
  if (kind->assumed) return FitAssumed(work, shape, options.bundle, kind);
  SelectionOptions selection = SelectionFor(input, options, *kind, fixed);
  selection.warp = shape.bent, selection.stretch = shape.stretched;
  if (!shape.plain()) selection.only = Promising(kind->choice);
  BundleOptions bundle = options.bundle;
  bundle.refine_intrinsics = !fixed;
  kind->choice = ChooseLens(kind->pool, selection, bundle, run);
  if (kind->choice.index >= 0) {
    kind->pool = kind->choice.candidates[kind->choice.index].fit;
    if (!selection.models.empty() && kind->choice.candidates.size() < 2) kind->choice.reason = fixed ? "fixed" : "given";
    return;
  }
  LensConfig config =
      selection.models.empty() ? LensConfig{kind->pool.config.model, {}, false, false} : selection.models.back();
  config.shared = kind->forced_sharing && kind->cameras.size() > 1;
  config.warp = shape.bent, config.stretch = shape.stretched;
  kind->pool = FitPool(kind->pool, config, bundle);
  if (!Solved(kind->pool.status) && MaySimplify(input, options, work, kind->cameras[0])) FitSimpler(bundle, kind);
}

/// One question about the boards by its option.
template <class Judge>
bool Decide(AutoOnOff option, Judge&& judge, std::string* reason) {
  *reason = option == AutoOnOff::kOn ? "asked for" : "not asked for";
  if (option != AutoOnOff::kAuto) return option == AutoOnOff::kOn;
  const ShapeChoice choice = judge();
  *reason = choice.reason;
  return choice.pays;
}

/// The boards' shape, judged on the kind with most views, which comes first: its shape is the start of the rig's.
BoardShape JudgeBoards(const CalibrateOptions& options, const RunContext& run, std::vector<Kind>* kinds,
                       CalibrateReport* report) {
  const auto largest = std::max_element(kinds->begin(), kinds->end(),
                                        [](const Kind& a, const Kind& b) { return a.pool.views.size() < b.pool.views.size(); });
  std::iter_swap(kinds->begin(), largest);
  const LensPool& pool = kinds->front().pool;
  SelectionOptions selection;
  selection.folds = std::max(3, options.holdout_folds);
  selection.max_views = options.holdout_views;
  BoardShape shape;
  shape.bent = Decide(
      options.warp, [&] { return ChooseWarp(pool, selection, options.bundle, run); }, &report->warp_reason);
  selection.warp = shape.bent;
  // libmrcal knows no such boards, and the control points of a spline take up most of a stretch: hundreds of slow steps.
  const bool mrcal = options.engine == Engine::kMrcal;
  const bool unable = mrcal || (options.stretch == AutoOnOff::kAuto && pool.config.model == LensModel::kSplined);
  shape.stretched = Decide(
      unable ? AutoOnOff::kOff : options.stretch,
      [&] {
        const ShapeChoice choice = ChooseStretch(pool, selection, options.bundle, run);
        report->stretch_untried = choice.untried;
        return choice;
      },
      &report->stretch_reason);
  if (unable) report->stretch_reason = "not judged with " + (mrcal ? "libmrcal" : ToString(pool.config));
  return shape;
}

/// The camera's assumptions go into the joint adjustment and the report.
void AssumeFor(int camera, Work* work, CalibrateReport* report) {
  const geometry::Camera& lens = work->state.cameras[camera];
  work->bundle.lens_prior.resize(work->monos.size());
  work->bundle.lens_prior[camera] = PriorOf(work->lens_step[camera], lens, SigmaOf(work->monos[camera]));
  report->cameras[camera].given_up =
      ToString(work->lens_step[camera], lens) + ", since by itself " + work->alone_failed[camera];
  report->cameras[camera].assumes = true;
}

void HandOn(const std::vector<Kind>& kinds, Work* work, CalibrateReport* report) {
  const size_t cameras = work->monos.size();
  work->state.cameras.resize(cameras);
  work->state.lens_group.resize(cameras);
  work->cam_from_board.resize(work->views.size());
  for (size_t c = 0; c < cameras; ++c) work->state.lens_group[c] = static_cast<int>(c);
  for (const Kind& kind : kinds) {
    std::vector<size_t> next(kind.cameras.size(), 0);
    for (size_t k = 0; k < kind.cameras.size(); ++k) {
      const int c = kind.cameras[k];
      work->state.cameras[c] = kind.pool.state.cameras[k];
      if (!kind.assumed) work->lens_step[c] = {kind.pool.config.model, kind.pool.config.spline, false, false};
      if (kind.assumed) AssumeFor(c, work, report);
      if (!kind.pool.config.shared) continue;
      work->state.lens_group[c] = kind.cameras[0];
      for (size_t other = 0; other < kind.cameras.size(); ++other) {
        if (other == k) continue;
        std::string& names = report->cameras[c].shares_lens_with;
        names += (names.empty() ? "" : ", ") + kind.pool.state.cameras[other].name;
      }
    }
    for (size_t i = 0; i < kind.pool.views.size(); ++i) {
      const int k = kind.pool.views[i].camera_idx;
      const int v = work->view_ids[kind.cameras[k]][next[k]++];
      work->cam_from_board[v] = kind.pool.state.world_from_board[i];
      work->views[v].weights = kind.pool.views[i].weights;
    }
  }
  work->state.board_warp_m = kinds[0].pool.state.board_warp_m;
  work->state.board_stretch = kinds[0].pool.state.board_stretch;
  work->bundle.refine_warp = kinds[0].pool.config.warp;
  work->bundle.refine_stretch = kinds[0].pool.config.stretch;
}

}  // namespace

std::vector<bool> HeldCameras(const std::vector<HeldPart>& fix, HeldPart::What what, const std::vector<CameraInput>& cameras) {
  std::vector<bool> flags(cameras.size(), false);
  for (const HeldPart& part : fix) {
    if (part.what != what) continue;
    if (part.cameras.empty()) flags.assign(cameras.size(), true);
    for (const std::string& name : part.cameras) flags[CameraIndex(cameras, name, "option 'fix' " + ToString(part))] = true;
  }
  return flags;
}

bool CalibrateLenses(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, Work* work,
                     CalibrateReport* report) {
  const std::vector<bool> fixed = HeldCameras(options.fix, HeldPart::What::kLenses, input.cameras);
  for (size_t c = 0; c < fixed.size(); ++c) {
    if (fixed[c] && !Given(input, input.cameras[c].name))
      throw UsageError("option 'fix' lenses: camera " + input.cameras[c].name + " is not in the given calibration");
  }
  work->bundle = options.bundle;
  work->bundle.fix_lens = fixed;
  if (!SolveMonos(input, options, fixed, run, work, report)) return false;
  report->cameras.resize(input.cameras.size());
  std::vector<Kind> kinds = FindKinds(input, options, fixed, *work);
  BoardShape shape;
  for (int round = 0; round < 2; ++round) {
    for (Kind& kind : kinds) {
      if (round == 0) kind.pool = MakePool(work->monos, kind.cameras, static_cast<int>(input.boards.size()));
      JudgeKind(input, options, *work, shape, run, &kind);
      if (kind.pool.status == Status::kOk || kind.pool.status == Status::kNotConverged) continue;
      Stop(kind.pool.status, "camera " + kind.pool.state.cameras[0].name + ": " + kind.pool.message, report);
      return false;
    }
    // A warped or stretched board mimics a more complex lens: lenses are chosen again when a board is one.
    if (round == 0 && (shape = JudgeBoards(options, run, &kinds, report)).plain()) break;
  }
  for (const Kind& kind : kinds) ReportKind(kind, report);
  HandOn(kinds, work, report);
  return true;
}

}  // namespace mvstudio::calib::internal
