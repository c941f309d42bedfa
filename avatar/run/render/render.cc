#include "avatar/run/render/render.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>

#include "avatar/maps/template_maps.h"
#include "avatar/nets/reference_renderer.h"
#include "avatar/run/pack/pack_rows.h"
#include "avatar/run/pack/template_view.h"
#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/pose/cuts.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

/// Sizes with every choice made.
struct Sizes {
  int network_px = 0, out_px = 0;
};

Sizes SizesOf(const AvatarModel& model, const RunConfig& config, const RenderOptions& o) {
  Sizes sizes;
  sizes.network_px = o.network_size_px > 0 ? o.network_size_px : config.pack.size_px;
  sizes.out_px = o.size_px > 0 ? o.size_px : config.pack.size_px;
  const int step = 1 << model.options.downs;
  if (sizes.network_px % step != 0 || sizes.network_px < 2 * step) {
    throw UsageError("option 'network-size' must be a multiple of " + std::to_string(step) + " and at least " +
                     std::to_string(2 * step) + " for this network, it is " + std::to_string(sizes.network_px));
  }
  return sizes;
}

/// The posed body in each image of a batch, as the network wants it.
void FillBodies(const RenderPlan& plan, size_t begin, const ModelOptions& options, int size_px, int num_threads,
                AvatarPack* pack) {
  const int64_t n = pack->joint_valid.size(0), area = int64_t{size_px} * size_px;
  if (!plan.HasBody()) return;
  pack->template_maps = at::zeros({n, kTemplateMaps, size_px, size_px}, at::kFloat);
  if (CorrectsColours(options)) {
    MVS_CHECK(plan.fitted, "a network that corrects the body's colours was trained with a fitted body");
    pack->template_colours = at::zeros({n, 3, size_px, size_px}, at::kByte);
  }
  if (TakesReferences(options)) {
    MVS_CHECK(plan.references, "a network that takes references needs them");
    pack->references = at::zeros({n, kReferenceMaps, size_px, size_px}, at::kByte);
  }
  const body::BodyTemplate& body = plan.fitted ? plan.fitted->person.body : *plan.body;
  ParallelFor(n, num_threads, [&](int64_t i) {
    const RenderJob& job = plan.jobs[begin + static_cast<size_t>(i)];
    const auto vertices = plan.Vertices(plan.track.poses[job.pose]);
    if (!vertices) return;
    FillTemplateMaps(body, *vertices, job.crop, size_px, pack->template_maps.data_ptr<float>() + i * kTemplateMaps * area);
    if (pack->template_colours.defined())
      FillTemplateColours(body, plan.fitted->textures, *vertices, job.crop, size_px,
                          pack->template_colours.data_ptr<uint8_t>() + i * 3 * area);
    const std::optional<int> frame = plan.foreign ? std::nullopt : std::optional<int>(plan.track.frames[job.pose]);
    if (pack->references.defined())
      FillReferenceRow(*plan.references, {job.crop, *vertices, frame}, options, i, pack->references);
  });
}

PoseBatch PosesOf(const RenderPlan& plan, size_t begin, size_t end, const ModelOptions& options, int network_px,
                  int num_threads) {
  const auto n = static_cast<int64_t>(end - begin);
  AvatarPack pack;
  const auto num_joints = static_cast<int64_t>(plan.joints.front().valid.size());
  pack.joints_in_cam = at::zeros({n, num_joints, 3}, at::kFloat);
  pack.joint_valid = at::zeros({n, num_joints}, at::kBool);
  pack.intrinsics = at::zeros({n, 4}, at::kFloat);
  for (size_t i = begin; i < end; ++i)
    FillPose(pack, static_cast<int64_t>(i - begin), plan.joints[plan.jobs[i].pose],
             dataset::ResizedCrop(plan.jobs[i].crop, network_px));
  FillBodies(plan, begin, options, network_px, num_threads, &pack);
  return PosesOf(pack);
}

/// (B, 4, H, W) in [0, 1] to another size: the mean over footprints when shrinking, cubic when growing.
at::Tensor ToSize(const at::Tensor& rgba, int64_t size) {
  if (rgba.size(2) == size) return rgba;
  return at::_upsample_bicubic2d_aa(rgba, {size, size}, /*align_corners=*/false).clamp(0, 1);
}

/// The latest images of a view, newest first; undefined before the first.
at::Tensor WithPast(const at::Tensor& image, const at::Tensor& past) {
  const at::Tensor older =
      past.defined() ? past.slice(1, 0, 3 * (kNumPrevious - 1)) : at::zeros_like(image).repeat({1, kNumPrevious - 1, 1, 1});
  return at::cat({image, older}, 1);
}

/// Frames from one image of a view to the next.
int StepOf(const std::vector<RenderJob>& jobs) {
  std::vector<int> frames;
  for (const RenderJob& job : jobs) {
    if (job.view == jobs.front().view) frames.push_back(job.frame);
  }
  return UsualStep(frames);
}

}  // namespace

void RenderImages(AvatarModel& model, const RunConfig& config, const RenderPlan& plan, const RenderOptions& options,
                  const RunContext& run, const std::function<void(const RenderJob&, const Image&)>& on_image) {
  at::set_num_threads(ResolveThreads(run.num_threads));
  const Sizes sizes = SizesOf(model, config, options);
  const bool memory = NumPreviousChannels(model.options) > 0;
  const size_t batch = memory ? 1 : static_cast<size_t>(std::max(1, options.batch));
  ProgressStage stage(run, "rendering", static_cast<int64_t>(plan.jobs.size()));
  const int step = StepOf(plan.jobs);
  const auto starts_anew = [&](size_t i) {
    const RenderJob &before = plan.jobs[i - 1], &job = plan.jobs[i];
    return job.view != before.view || job.frame - before.frame != step ||
           dataset::IsCut(plan.track.poses[before.pose], plan.track.poses[job.pose], step);
  };
  at::Tensor past;
  for (size_t begin = 0; begin < plan.jobs.size(); begin += batch) {
    const size_t end = std::min(plan.jobs.size(), begin + batch);
    if (begin > 0 && starts_anew(begin)) past = at::Tensor();
    const PoseBatch poses = PosesOf(plan, begin, end, model.options, sizes.network_px, run.num_threads);
    const Rendering r = Render(model, poses, sizes.network_px, sizes.network_px, {}, past);
    if (memory) past = WithPast(r.image, past);
    const at::Tensor rgba = ToSize(at::cat({r.image, CleanAlpha(r.mask_prob).unsqueeze(1)}, 1), sizes.out_px);
    for (size_t i = begin; i < end; ++i) {
      const RenderJob& job = plan.jobs[i];
      const Image crop = ImageOfBytes((rgba[static_cast<int64_t>(i - begin)] * 255).round().clamp(0, 255).to(at::kByte));
      on_image(job, options.frame == RenderFrame::kCrop
                        ? crop
                        : dataset::Resample(crop, dataset::ResizedCrop(job.crop, sizes.out_px), job.camera));
    }
    stage.Advance(static_cast<int64_t>(end - begin));
  }
}

}  // namespace mvstudio::avatar
