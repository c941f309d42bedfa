#include "avatar/run/gaussians/gaussian_render.h"

#include <optional>

#include "avatar/splats/render.h"
#include "core/check.h"
#include "core/error.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

/// Colours premultiplied, and opacity.
Image Rgba(const body::RenderedBody& rendered) {
  Image out(rendered.image.width, rendered.image.height, 4);
  for (size_t i = 0; i < rendered.cover.pixels.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) out.pixels[4 * i + c] = rendered.image.pixels[3 * i + c];
    out.pixels[4 * i + 3] = rendered.cover.pixels[i];
  }
  return out;
}

}  // namespace

void RenderGaussianImages(const splats::CloudFile& file, const RunConfig& config, const RenderPlan& plan,
                          const RenderOptions& options, const RunContext& run,
                          const std::function<void(const RenderJob&, const Image&)>& on_image) {
  if (options.network_size_px > 0)
    throw UsageError("option 'network-size': Gaussians have no network; option 'size' is the size of the images");
  MVS_CHECK(plan.fitted, "Gaussians lie on a fitted body");
  const body::BodyTemplate& body = plan.fitted->person.body;
  const int size_px = options.size_px > 0 ? options.size_px : config.pack.size_px;
  ProgressStage stage(run, "rendering", static_cast<int64_t>(plan.jobs.size()));
  for (const RenderJob& job : plan.jobs) {
    const geometry::RigCamera crop = dataset::ResizedCrop(job.crop, size_px);
    const std::optional<Eigen::Matrix3Xf> vertices = plan.Vertices(plan.track.poses[job.pose]);
    const Image image = vertices ? Rgba(RenderGaussians(file.cloud, body, *vertices, crop, {file.mip, run.num_threads}))
                                 : Image(size_px, size_px, 4);
    on_image(job, options.frame == RenderFrame::kCrop ? image : dataset::Resample(image, crop, job.camera));
    stage.Advance();
  }
}

}  // namespace mvstudio::avatar
