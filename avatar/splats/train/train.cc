#include "avatar/splats/train/train.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "avatar/metrics/masks.h"
#include "avatar/metrics/scores.h"
#include "avatar/splats/bend.h"
#include "avatar/splats/render.h"
#include "avatar/splats/train/initial.h"
#include "avatar/splats/train/train_step.h"
#include "core/check.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::splats {
namespace {

void CheckViews(const body::BodyTemplate& body, const std::vector<TrainView>& views) {
  for (const TrainView& view : views) {
    MVS_CHECK(view.vertices && view.vertices->cols() == body.vertices.cols(), view.name << ": another body's vertices");
    MVS_CHECK(view.image.width == view.camera.camera.width_px && view.image.height == view.camera.camera.height_px,
              view.name << ": an image of another size than its camera's");
    MVS_CHECK(view.mask.width == view.image.width && view.mask.height == view.image.height && view.mask.channels == 1,
              view.name << ": a mask of another size than its image");
    MVS_CHECK(std::any_of(view.mask.pixels.begin(), view.mask.pixels.end(), [](uint8_t v) { return v >= 128; }),
              view.name << ": no person in the mask");
  }
}

/// At most `count` of them, evenly spread.
std::vector<const TrainView*> Some(const std::vector<TrainView>& views, size_t count) {
  std::vector<const TrainView*> out;
  const size_t n = std::min(count, views.size());
  for (size_t k = 0; k < n; ++k) out.push_back(&views[(2 * k + 1) * views.size() / (2 * n)]);
  return out;
}

std::vector<float> SizesIn(const Cloud& cloud, const body::BodyTemplate& body, const std::vector<TrainView>& views,
                           int num_threads) {
  constexpr size_t kViews = 24;  // enough to have each place near its nearest camera
  std::vector<PinholeView<float>> cameras;
  std::vector<const Eigen::Matrix3Xf*> vertices;
  for (const TrainView* view : Some(views, kViews)) {
    cameras.push_back(ViewOf<float>(view->camera));
    vertices.push_back(view->vertices.get());
  }
  return PixelSizes(cloud, body.faces, cameras, vertices, num_threads);
}

/// Every image once before any comes again, shuffled anew each time.
class ViewOrder {
 public:
  ViewOrder(size_t n, Rng* rng) : order_(n), rng_(rng) { std::iota(order_.begin(), order_.end(), size_t{0}); }
  size_t Next() {
    if (at_ == 0) {
      for (size_t i = order_.size(); i > 1; --i)
        std::swap(order_[i - 1], order_[static_cast<size_t>(rng_->Index(static_cast<int64_t>(i)))]);
    }
    const size_t next = order_[at_];
    at_ = (at_ + 1) % order_.size();
    return next;
  }

 private:
  std::vector<size_t> order_;
  Rng* rng_;
  size_t at_ = 0;
};

/// The state of one training.
struct Training {
  const body::BodyTemplate& body;
  const std::vector<TrainView>& views;
  const std::vector<TrainView>& validation;
  const TrainOptions& options;
  const RunContext& run;
  Rng rng;
  ViewOrder order;
  Cloud cloud;
  Eigen::Matrix2Xi bones;  // of the faces; empty without a corrective of poses
  AdamState adam;
  std::vector<float> pixel_m;
  ViewSpaceGradients gradients;
  LossTerms sum;  // since the last row
  int summed = 0;
  TrainResult result;
  double best_ssim = -std::numeric_limits<double>::infinity();

  void ForgetGradients() {
    gradients.sum.assign(cloud.size(), 0.f);
    gradients.seen.assign(cloud.size(), 0);
  }
};

void AddSum(const LossTerms& loss, Training* t) {
  t->sum.l1 += loss.l1, t->sum.ssim += loss.ssim, t->sum.mask += loss.mask, t->sum.total += loss.total;
  ++t->summed;
}

/// What the corrective of poses needs of a batch.
BatchBends BendsOf(const std::vector<const TrainView*>& batch, const Training& t) {
  BatchBends out;
  if (!t.cloud.values.bends) return out;
  out.bones = t.bones;
  for (const TrainView* view : batch) out.turns.push_back(BoneTurns(t.body, *view->vertices));
  return out;
}

/// False where the loss of the batch is not finite: nothing is changed then.
bool Step(Training* t) {
  std::vector<const TrainView*> batch;
  for (int k = 0; k < t->options.batch; ++k) batch.push_back(&t->views[t->order.Next()]);
  const BatchResult step = BatchGradient(t->cloud, t->body.faces, batch, BendsOf(batch, *t), t->options.weights,
                                         t->options.smooth, t->run.num_threads);
  t->result.skipped = step.skipped;
  if (!std::isfinite(step.loss.total)) {
    t->result.status = Status::kNotConverged;
    for (const TrainView* view : batch) t->result.trouble += (t->result.trouble.empty() ? "" : "; ") + view->name;
    return false;
  }
  for (size_t i = 0; i < t->cloud.size(); ++i) t->gradients.sum[i] += step.view_space[i], t->gradients.seen[i] += step.seen[i];
  AddSum(step.loss, t);
  const double done = static_cast<double>(t->adam.step) / std::max(1, t->options.steps);
  const double share = std::pow(t->options.decay, done);
  AdamStep(step.gradient, t->options.rates, share, &t->adam, &t->cloud.values);
  for (float& value : t->cloud.values.bend) value *= static_cast<float>(1 - share * t->options.bend_decay);
  Confine(&t->cloud);
  return true;
}

/// Gaussians are divided in the first half, a dozen times, and have the second to settle.
void MaybeDensify(int step, Training* t) {
  constexpr int kTimes = 12;
  const int every = std::max(1, t->options.steps / (2 * kTimes));
  if (!t->options.densify || step % every != 0 || step > t->options.steps / 2) return;
  const DensityReport report =
      Densify(t->options.density, t->body.faces, t->body.vertices, t->gradients, &t->rng, &t->cloud, &t->adam, &t->pixel_m);
  t->result.density.cloned += report.cloned;
  t->result.density.split += report.split;
  t->result.density.pruned += report.pruned;
  if (t->options.smooth) SetFilters(t->pixel_m, &t->cloud);
  t->ForgetGradients();
}

TrainRow RowOf(int step, const ViewScores& scores, const Training& t) {
  TrainRow row;
  row.step = step;
  const double share = 1.0 / std::max(1, t.summed);
  row.loss = {share * t.sum.l1, share * t.sum.ssim, share * t.sum.mask, share * t.sum.total};
  row.validation_ssim = Mean(scores.ssim), row.validation_psnr_db = Mean(FiniteValues(scores.psnr_db));
  row.gaussians = static_cast<int64_t>(t.cloud.size());
  return row;
}

void Look(int step, const std::function<void(const TrainRow&, const Cloud&)>& on_row, Training* t) {
  ViewScores scores;
  if (!t->validation.empty()) scores = ScoreViews(t->cloud, t->body, t->validation, t->options.smooth, t->run);
  t->result.rows.push_back(RowOf(step, scores, *t));
  t->sum = {}, t->summed = 0;
  const TrainRow& row = t->result.rows.back();
  if (t->validation.empty() || row.validation_ssim > t->best_ssim) {
    t->best_ssim = row.validation_ssim;
    t->result.cloud = t->cloud, t->result.best_step = step, t->result.validation_ssim = scores.ssim;
  }
  if (on_row) on_row(row, t->cloud);
}

Cloud FirstCloud(const body::BodyTemplate& body, const body::Textures& textures, const std::vector<TrainView>& views,
                 const TrainOptions& options, const RunContext& run) {
  const int64_t count = options.count > 0 ? options.count : AutomaticCount(body, views);
  Cloud cloud = CoverBody(body, textures, count, options.degree, run.seed);
  cloud.values.bends = options.bends;
  if (options.bends) cloud.values.bend.assign(cloud.size() * static_cast<size_t>(kBendSize), 0.f);
  return cloud;
}

}  // namespace

int64_t AutomaticCount(const body::BodyTemplate& body, const std::vector<TrainView>& views) {
  constexpr double kPerPixel = 4;  // twice as many gain 0.002 of SSIM on a validation camera, in twice the time
  constexpr int64_t kFewest = 2000, kMost = 40000;
  std::vector<double> pixel_m;
  for (const TrainView& view : views) {
    const Eigen::Vector3d middle = view.vertices->cast<double>().rowwise().mean();
    pixel_m.push_back((view.camera.cam_from_world * middle)[2] / view.camera.camera.fx());
  }
  const double size = UpperMedian(FiniteValues(pixel_m));
  const double count = kPerPixel * SurfaceArea(body) / (size * size);
  if (!(count > 0)) return kFewest;
  return static_cast<int64_t>(std::clamp(count, static_cast<double>(kFewest), static_cast<double>(kMost)));
}

ViewScores ScoreViews(const Cloud& cloud, const body::BodyTemplate& body, const std::vector<TrainView>& views, bool mip,
                      const RunContext& run) {
  ViewScores scores;
  scores.ssim.resize(views.size()), scores.psnr_db.resize(views.size());
  ParallelFor(static_cast<int64_t>(views.size()), run.num_threads, [&](int64_t i) {
    const TrainView& view = views[static_cast<size_t>(i)];
    const body::RenderedBody rendered = RenderGaussians(cloud, body, *view.vertices, view.camera, {mip, 1});
    metrics::Mask mask(view.mask.pixels.size()), shown(view.mask.pixels.size());
    Image truth = view.image;
    for (size_t k = 0; k < mask.size(); ++k) {
      mask[k] = view.mask.pixels[k] >= 128, shown[k] = rendered.cover.pixels[k] >= 128;
      for (size_t c = 0; c < 3 && !mask[k]; ++c) truth.pixels[3 * k + c] = 0;
    }
    const metrics::ImageScore score =
        metrics::ScoreImage(metrics::FromImage(truth), mask, metrics::FromImage(rendered.image), shown);
    scores.ssim[static_cast<size_t>(i)] = score.bbox.ssim, scores.psnr_db[static_cast<size_t>(i)] = score.bbox.psnr_db;
  });
  return scores;
}

TrainResult TrainCloud(const body::BodyTemplate& body, const body::Textures& textures, const std::vector<TrainView>& views,
                       const std::vector<TrainView>& validation, const TrainOptions& options, const RunContext& run,
                       const std::function<void(const TrainRow&, const Cloud&)>& on_row) {
  MVS_CHECK(!views.empty() && options.batch > 0 && options.check_every > 0, "nothing to train on");
  CheckViews(body, views), CheckViews(body, validation);
  Rng rng(run.seed ^ 0x5eedu);
  Training t{
      body, views, validation, options, run, rng, {views.size(), nullptr}, FirstCloud(body, textures, views, options, run), {},
      {},   {},    {},         {},      0,   {}};
  t.order = ViewOrder(views.size(), &t.rng);
  t.adam = MakeAdam(t.cloud.size(), options.degree, options.bends);
  if (options.bends) t.bones = BonesOfFaces(body);
  t.pixel_m = SizesIn(t.cloud, body, views, run.num_threads);
  if (options.smooth) SetFilters(t.pixel_m, &t.cloud);
  t.ForgetGradients();
  ProgressStage stage(run, "training Gaussians", options.steps);
  Look(0, on_row, &t);
  for (int step = 1; step <= options.steps; ++step) {
    if (!Step(&t)) return t.result;
    MaybeDensify(step, &t);
    if (step % options.check_every == 0 || step == options.steps) Look(step, on_row, &t);
    stage.Advance(1);
  }
  return t.result;
}

}  // namespace mvstudio::splats
