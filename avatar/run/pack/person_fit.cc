#include "avatar/run/pack/person_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>

#include "avatar/body/fit/pose_by_images.h"
#include "avatar/body/templates/read.h"
#include "avatar/run/pack/person_views.h"
#include "avatar/run/surface/network_training.h"
#include "core/check.h"
#include "core/choice/heldout_choice.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "core/stopwatch.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

Image Grey(const Image& rgb) {
  Image grey(rgb.width, rgb.height, 1);
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const uint8_t* p = rgb.pixels.data() + 3 * i;
    grey.pixels[i] = static_cast<uint8_t>(std::lround(0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]));
  }
  return grey;
}

std::vector<body::FitStep> ReadSteps(const dataset::PanopticDataset& data, const std::vector<PersonStep>& sources,
                                     const PersonFitOptions& options, bool brightness, const RunContext& run) {
  std::vector<body::FitStep> steps(sources.size());
  ProgressStage stage(run, "reading silhouettes", static_cast<int64_t>(sources.size()));
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(sources.size()), run.num_threads, [&](int64_t i) {
    const PersonStep& source = sources[i];
    body::FitStep& step = steps[i];
    step.frame = source.frame;
    step.joints.x_in_world = source.pose->x_in_world, step.joints.valid = dataset::PlausibleJoints(*source.pose);
    for (const geometry::RigCamera* camera : source.cameras) {
      PersonCrop crop = ReadPersonCrop(data, source, *camera, options.max_px);
      step.views.push_back({camera->camera.name, crop.camera, std::make_shared<body::MaskOutline>(std::move(crop.mask)),
                            brightness ? std::make_shared<Image>(Grey(crop.image)) : nullptr});
    }
    const std::lock_guard<std::mutex> lock(mutex);
    stage.Advance();
  });
  return steps;
}

/// The time steps that the body was posed in, without the rejected silhouettes.
std::vector<PersonStep> PosedSources(const std::vector<PersonStep>& sources, const PersonFit& fit) {
  const auto is_rejected = [&](int frame, const geometry::RigCamera* camera) {
    return std::any_of(fit.fit.rejected.begin(), fit.fit.rejected.end(), [&](const body::RejectedView& view) {
      return view.frame == frame && view.camera == camera->camera.name;
    });
  };
  std::vector<PersonStep> posed;
  for (PersonStep source : sources) {
    auto& cameras = source.cameras;
    cameras.erase(std::remove_if(cameras.begin(), cameras.end(),
                                 [&](const geometry::RigCamera* camera) { return is_rejected(source.frame, camera); }),
                  cameras.end());
    if (fit.result.person.seen.count(source.frame) && !cameras.empty()) posed.push_back(source);
  }
  return posed;
}

/// Colours by all cameras in time steps spread evenly.
void BakeTextures(const dataset::PanopticDataset& data, const std::vector<PersonStep>& sources, const PersonFitOptions& options,
                  const RunContext& run, PersonFit* out) {
  const body::PersonBody& person = out->result.person;
  const std::vector<PersonStep> posed = ThinnedSteps(PosedSources(sources, *out), options.max_texture_views);
  body::TextureBaker baker(person.body, options.texture_px);
  std::map<std::string, int> cameras;
  ProgressStage stage(run, "baking the texture", static_cast<int64_t>(posed.size()));
  for (const PersonStep& source : posed) {
    const body::BodyPose pose = ToBodyPose(person.body, person.seen.at(source.frame));
    for (const geometry::RigCamera* camera : source.cameras) {
      PersonCrop crop = ReadPersonCrop(data, source, *camera, options.max_px);
      const int camera_idx = cameras.emplace(camera->camera.name, static_cast<int>(cameras.size())).first->second;
      baker.Add({crop.camera, std::move(crop.image), std::move(crop.mask), SkinVertices(person.body, pose), camera_idx}, run);
    }
    stage.Advance();
  }
  const std::vector<Eigen::Array3d> gains = baker.Gains();
  out->result.textures = baker.Finish(gains);
  out->texture_seen = baker.SeenShare();
  for (const auto& [name, index] : cameras) out->camera_gains[name] = gains[static_cast<size_t>(index)];
}

/// A batch at a time: silhouettes of a whole take need more memory than there is.
void PoseOthers(const dataset::PanopticDataset& data, const PersonFitOptions& options, const RunContext& run, PersonFit* out) {
  constexpr size_t kBatch = 64;
  std::map<int, body::ArticulatedPose>& seen = out->result.person.seen;
  std::vector<int> frames;
  for (const int frame : options.pose_frames) {
    if (!seen.count(frame)) frames.push_back(frame);
  }
  std::vector<std::string> missing;  // nothing that a pose depends on
  const std::vector<PersonStep> sources = FindPersonSteps(data, options.person, options.cameras, frames, &missing);
  const body::MeanBrightness* brightness = out->fit.brightness ? &*out->fit.brightness : nullptr;
  std::vector<double> before, after;
  for (size_t at = 0; at < sources.size(); at += kBatch) {
    const std::vector<PersonStep> batch(sources.begin() + at, sources.begin() + std::min(sources.size(), at + kBatch));
    const body::StepPoses posed =
        body::PoseByImages(out->result.person, brightness, ReadSteps(data, batch, options, brightness != nullptr, run), run);
    seen.insert(posed.poses.begin(), posed.poses.end());
    out->tracked.rejected.insert(out->tracked.rejected.end(), posed.rejected.begin(), posed.rejected.end());
    before.insert(before.end(), posed.iou_before.begin(), posed.iou_before.end());
    after.insert(after.end(), posed.iou.begin(), posed.iou.end());
  }
  out->tracked.frames = static_cast<int>(after.size());
  out->tracked.iou_before = Mean(before), out->tracked.iou = Mean(after);
}

/// The simplest template that held-out silhouettes do not show to be worse than the best; where none are held out, the first.
void FitTemplates(const std::vector<body::FitStep>& steps, const PersonFitOptions& options, const RunContext& run,
                  PersonFit* out) {
  body::BodyFitOptions fit;
  fit.fit_surface = options.fit_surface, fit.use_brightness = options.use_brightness;
  std::vector<body::BodyFit> fits;
  std::vector<HeldOutCandidate> losses;
  for (const std::string& path : options.templates) {
    const Stopwatch watch;
    fits.push_back(body::FitBody(body::ReadTemplate(path), steps, fit, run));
    const double seconds = watch.Seconds();
    const std::string name = path.empty() ? "mannequin" : path;
    out->templates.push_back({name, fits.back().iou, seconds, false});
    losses.push_back({name, fits.back().held_out_loss});
  }
  const HeldOutChoice choice = ChooseHeldOut(losses, {});
  const size_t index = choice.status == Status::kOk ? static_cast<size_t>(choice.index) : 0;
  out->templates[index].kept = true;
  out->fit = std::move(fits[index]);
}

body::DynamicFit FitDynamicSurface(const std::vector<body::FitStep>& steps, const std::vector<body::RejectedView>& rejected,
                                   const PersonFitOptions& options, const RunContext& run, body::PersonBody* person) {
  const auto network = [&](const body::TakeOutlines& take) {
    NetworkTrainingOptions training;
    training.steps = options.network_steps, training.seed = run.seed;
    return NetworkTrainer(take, training, run);
  };
  return body::FitMovingSurface(steps, rejected, options.dynamic, network, run, person);
}

/// Which images a body may have seen.
void NoteImages(const PersonFitOptions& options, body::TexturedPerson* person) {
  for (const std::string& name : options.cameras) {
    std::array<int, 2> camera{};
    MVS_CHECK(dataset::ParsePanopticName(name, &camera[0], &camera[1]), "camera " << name << " has no Panoptic name");
    person->cameras.push_back(camera);
  }
  person->frames = options.frames;
}

}  // namespace

PersonFit FitPerson(const dataset::PanopticDataset& data, const PersonFitOptions& options, const RunContext& run) {
  MVS_CHECK(!options.templates.empty() && options.max_silhouettes > 0 && options.max_px >= 64 && options.texture_px >= 2,
            "options of the fit");
  PersonFit out;
  const std::vector<PersonStep> all = FindPersonSteps(data, options.person, options.cameras, options.frames, &out.missing);
  if (all.empty())
    throw UsageError(
        "no training frame of person " + std::to_string(options.person) +
        " has an image with a mask: a body cannot be fitted; build masks (`mvstudio mask`) or take option 'fit' off");
  const std::vector<PersonStep> sources = ThinnedSteps(all, options.max_silhouettes);
  std::vector<body::FitStep> steps = ReadSteps(data, sources, options, options.use_brightness, run);
  body::HoldOutViews(&steps);
  FitTemplates(steps, options, run, &out);
  out.result.person = std::move(out.fit.person);
  out.result.offset_m = out.fit.offsets, out.result.offset_sigma_m = out.fit.offset_sigma_m;
  NoteImages(options, &out.result);
  if (out.fit.offset_sigma_m.size() > 0)  // a surface was fitted
    out.dynamic = FitDynamicSurface(steps, out.fit.rejected, options, run, &out.result.person);
  BakeTextures(data, sources, options, run, &out);
  if (out.fit.status == Status::kOk) PoseOthers(data, options, run, &out);
  return out;
}

}  // namespace mvstudio::avatar
