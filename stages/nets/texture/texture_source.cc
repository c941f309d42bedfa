#include "stages/nets/texture/texture_source.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "avatar/run/gaussians/gaussian_render.h"
#include "avatar/run/render/render.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/views/crop.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

void RequireCameras(const TextureSource& source) {
  for (const std::string& camera : source.cameras) {
    if (source.data.rig.Find(camera) < 0)
      throw UsageError(source.data.root + " has no camera " + camera +
                       ", which the body was fitted to; pass the right dataset with option 'dataset'");
  }
}

TextureSource OpenRunSource(const std::string& folder, const std::string& dataset) {
  TextureSource source;
  source.run_folder = folder, source.config = avatar::OpenRun(folder, dataset);
  if (!source.config->pack.fitted)
    throw UsageError(folder + " was trained without a fitted body, which has the texture; train with option 'fit' auto");
  source.data = dataset::OpenPanopticDataset(source.config->dataset);
  source.person = source.config->pack.person;
  source.cameras = source.config->split.train_cameras, source.frames = source.config->split.train_frames;
  source.body = *source.config->pack.fitted;
  return source;
}

/// Colours over opacity, and a mask of what is opaque.
body::TextureView Opaque(const Image& rgba, const geometry::RigCamera& camera, Eigen::Matrix3Xf vertices) {
  body::TextureView view{camera, Image(rgba.width, rgba.height, 3), Image(rgba.width, rgba.height, 1), std::move(vertices), 0};
  for (size_t i = 0; i < view.mask.pixels.size(); ++i) {
    const int alpha = rgba.pixels[4 * i + 3];
    if (alpha < 128) continue;
    view.mask.pixels[i] = 255;
    for (size_t c = 0; c < 3; ++c)
      view.image.pixels[3 * i + c] = static_cast<uint8_t>(std::min(255, (rgba.pixels[4 * i + c] * 255 + alpha / 2) / alpha));
  }
  return view;
}

}  // namespace

TextureSource OpenTextureSource(const std::string& path, const std::string& dataset) {
  const bool is_run = fs::exists(path + "/" + avatar::kRunConfigFile);
  TextureSource source;
  if (is_run) {
    source = OpenRunSource(path, dataset);
  } else {
    const std::string file = fs::is_directory(path) ? path + "/" + body::kPersonFileName : path;
    source.body = body::ReadPerson(file);
    if (source.body.cameras.empty() || source.body.frames.empty())
      throw UsageError(file + " does not say which images it was fitted to: fit it again (`mvstudio avatar fit`)");
    if (dataset.empty()) throw UsageError(file + " is a body: its images come from option 'dataset'");
    source.data = dataset::OpenPanopticDataset(dataset);
    source.person = avatar::ChoosePerson(source.data, -1);
    for (const auto& [panel, node] : source.body.cameras) source.cameras.push_back(Format("%02d_%02d", panel, node));
    source.frames = source.body.frames;
  }
  RequireCameras(source);
  return source;
}

std::vector<body::TextureView> RenderTurn(const TextureSource& source, int count, int size_px, const RunContext& run) {
  const avatar::RunConfig& config = *source.config;
  avatar::RenderOptions options;
  options.turntable = count, options.rest_pose = true, options.size_px = size_px;
  avatar::RenderPlan plan = MakeRenderPlan(config, source.data, options);
  if (!plan.fitted) plan.fitted = config.pack.fitted;  // a network that does not see the body is held against it all the same
  std::vector<body::TextureView> views;
  const auto add = [&](const avatar::RenderJob& job, const Image& rgba) {
    const auto vertices = plan.Vertices(plan.track.poses[job.pose]);
    if (vertices) views.push_back(Opaque(rgba, dataset::ResizedCrop(job.crop, rgba.width), *vertices));
  };
  if (avatar::HoldsGaussians(source.run_folder)) {
    const auto faces = static_cast<int>(config.pack.fitted->person.body.faces.cols());
    const splats::CloudFile file = splats::ReadCloud(source.run_folder + "/" + avatar::kGaussiansFile, faces);
    RenderGaussianImages(file, config, plan, options, run, add);
  } else {
    avatar::AvatarModel model = avatar::LoadModel(source.run_folder + "/" + avatar::kCheckpointFile);
    RenderImages(model, config, plan, options, run, add);
  }
  return views;
}

}  // namespace mvstudio::stages
