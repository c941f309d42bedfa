#include <algorithm>
#include <cmath>

#include "calib/lens/simpler_lens.h"
#include "calib/pipeline/calibrate_steps.h"
#include "core/format.h"

/// What the calibration does when the boards do not determine a lens.
namespace mvstudio::calib::internal {
namespace {

constexpr double kUsualSigmaPx = 0.3;  // of a corner, where a camera's own fit says nothing

bool Solved(Status status) { return status == Status::kOk || status == Status::kNotConverged; }

/// Cameras with the lens of `camera`, itself among them.
std::vector<int> LensMates(const Work& work, int camera) {
  std::vector<int> mates;
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    const bool same = !work.state.lens_group.empty() && work.state.lens_group[c] == work.state.lens_group[camera];
    if (static_cast<int>(c) == camera || same) mates.push_back(static_cast<int>(c));
  }
  return mates;
}

std::vector<View> OwnViews(const Work& work, int camera) {
  std::vector<View> views;
  for (int v : work.view_ids[camera]) {
    views.push_back(work.views[v]);
    views.back().weights = work.prior[v];
  }
  return views;
}

/// The cameras as one pool under the lens of `step`; each by itself first.
LensPool FitStep(const CalibrateInput& input, const CalibrateOptions& options, const LensStep& step,
                 const std::vector<int>& cameras, Work* work) {
  std::vector<MonoSolution> monos = work->monos;
  LensPool failed;
  for (int c : cameras) {
    monos[c] = SolveUnder(input.cameras[c], step, OwnViews(*work, c), options.bundle);
    failed.status = monos[c].status, failed.message = monos[c].message;
    if (!Solved(monos[c].status)) return failed;
  }
  for (int c : cameras) work->monos[c] = monos[c];
  BundleOptions bundle = options.bundle;
  for (int c : cameras) bundle.lens_prior.push_back(PriorOf(step, monos[c].state.cameras[0], SigmaOf(monos[c])));
  LensConfig config{step.model, step.spline, cameras.size() > 1, work->bundle.refine_warp, work->bundle.refine_stretch};
  LensPool pool = MakePool(monos, cameras, static_cast<int>(input.boards.size()));
  pool.state.board_warp_m = work->state.board_warp_m;
  pool.state.board_stretch = work->state.board_stretch;
  return FitPool(pool, config, bundle);
}

void TakePool(const LensPool& pool, const LensStep& step, const std::vector<int>& cameras, Work* work) {
  std::vector<size_t> next(cameras.size(), 0);
  for (size_t i = 0; i < pool.views.size(); ++i) {
    const int k = pool.views[i].camera_idx, v = work->view_ids[cameras[k]][next[k]++];
    work->cam_from_board[v] = pool.state.world_from_board[i];
    work->views[v].weights = pool.views[i].weights;
  }
  work->bundle.lens_prior.resize(work->state.cameras.size());
  for (size_t k = 0; k < cameras.size(); ++k) {
    const int c = cameras[k];
    work->state.cameras[c] = pool.state.cameras[k];
    work->lens_step[c] = step;
    work->bundle.lens_prior[c] = PriorOf(step, pool.state.cameras[k], SigmaOf(work->monos[c]));
  }
}

void Note(const LensStep& before, const LensStep& after, const std::string& why, const geometry::Camera& camera,
          CameraReport* report) {
  report->given_up += (report->given_up.empty() ? "" : "; ") + ToString(before, camera) + " given up for " +
                      ToString(after, camera) + ": " + why;
  report->assumes = after.assume_centre || after.assume_focal;
}

}  // namespace

double SigmaOf(const MonoSolution& mono) {
  const bool known = Solved(mono.status) && std::isfinite(mono.bundle.sigma_px) && mono.bundle.sigma_px > 0;
  return known ? mono.bundle.sigma_px : kUsualSigmaPx;
}

MonoSolution SolveUnder(const CameraInput& camera, const LensStep& step, const std::vector<View>& views,
                        const BundleOptions& options) {
  BundleOptions bundle = options;
  bundle.num_threads = 1;
  geometry::Camera lens =
      geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, std::max(camera.width_px, camera.height_px));
  lens = WithModel(lens, step.model, step.spline);
  const LensPrior prior = PriorOf(step, lens, kUsualSigmaPx);
  if (prior.weight.size() > 0) bundle.lens_prior = {prior};
  if (!step.assume_focal) return CalibrateMono(lens, views, bundle, true);
  lens.params.head<4>() = prior.mean.head<4>();
  return RefineMono(lens, views, bundle);
}

std::string WhyFocalLengthIsOpen(const Work& work, const CameraReport& camera, size_t camera_idx) {
  constexpr double kMaxSigma = 0.25, kBeyondAssumed = 4;  // of the focal length; standard deviations of the assumed one
  constexpr double kNoPerspective = 10;                   // focal length over the image's longer side
  const geometry::Camera& lens = work.state.cameras[camera_idx];
  const LensStep step = camera_idx < work.lens_step.size() ? work.lens_step[camera_idx] : LensStep();
  bool open = camera.focal_sigma_px > kMaxSigma * camera.focal_px;
  if (step.assume_focal) {
    const LensPrior prior = PriorOf(step, lens, kUsualSigmaPx);
    const Eigen::Array2d beyond = (lens.params.head<2>() - prior.mean.head<2>()).array();
    open = open || (beyond * prior.weight.head<2>().array().sqrt() / kUsualSigmaPx).maxCoeff() > kBeyondAssumed;
  }
  if (!open) return "";
  if (!work.alone_failed[camera_idx].empty()) return work.alone_failed[camera_idx];
  const std::string name = "camera " + camera.name;
  if (camera.focal_px > kNoPerspective * std::max(lens.width_px, lens.height_px))
    return name +
           Format(
               ": the boards do not determine its focal length: they show no perspective, as boards parallel to the image "
               "or very far away (it would be about %.0f px): show the board tilted and nearer, or hold a known lens",
               camera.focal_px);
  return name + ": the boards do not determine its focal length: show the board tilted";
}

bool MaySimplify(const CalibrateInput& input, const CalibrateOptions& options, const Work& work, int camera) {
  const bool given = input.start && input.start->Find(input.cameras[camera].name) >= 0;
  const bool fixed = static_cast<size_t>(camera) < work.bundle.fix_lens.size() && work.bundle.fix_lens[camera];
  return !options.model && options.engine == Engine::kMvstudio && !given && !fixed;
}

bool SimplifyLenses(const CalibrateInput& input, const CalibrateOptions& options, const std::vector<int>& cameras,
                    const std::string& why, Work* work, CalibrateReport* report) {
  std::vector<bool> done(input.cameras.size(), false);
  bool any = false;
  for (int camera : cameras) {
    if (done[camera] || !MaySimplify(input, options, *work, camera)) continue;
    const std::vector<int> mates = LensMates(*work, camera);
    for (int mate : mates) done[mate] = true;
    const LensStep before = work->lens_step[camera];
    for (auto step = NextSimpler(before); step; step = NextSimpler(*step)) {
      const LensPool pool = FitStep(input, options, *step, mates, work);
      if (!Solved(pool.status)) continue;
      TakePool(pool, *step, mates, work);
      for (int mate : mates) Note(before, *step, why, work->state.cameras[mate], &report->cameras[mate]);
      any = true;
      break;
    }
  }
  return any;
}

std::vector<int> MostDemanding(const Work& work) {
  size_t most = 0;
  std::vector<int> cameras;
  const auto demand = [&](size_t c) {
    const LensStep& step = work.lens_step[c];
    return 3 * static_cast<size_t>(work.state.cameras[c].params.size()) - step.assume_centre - step.assume_focal;
  };
  for (size_t c = 0; c < work.state.cameras.size(); ++c) most = std::max(most, demand(c));
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    if (demand(c) == most) cameras.push_back(static_cast<int>(c));
  }
  return cameras;
}

}  // namespace mvstudio::calib::internal
