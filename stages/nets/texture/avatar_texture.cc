#include "stages/nets/texture/avatar_texture.h"

#include <algorithm>
#include <cmath>

#include "avatar/body/texture/unsharp.h"
#include "avatar/metrics/scores.h"
#include "avatar/run/pack/person_views.h"
#include "avatar/run/pack/split_side.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/format.h"

namespace mvstudio::stages {
namespace {

using Json = nlohmann::ordered_json;
using body::TextureView;

constexpr ChoiceWords<TextureMethod, 4> kMethods = {{{TextureMethod::kAverage, "average"},
                                                     {TextureMethod::kMedian, "median"},
                                                     {TextureMethod::kGraphCut, "graph-cut"},
                                                     {TextureMethod::kRefine, "refine"}}};
constexpr ChoiceWords<TextureFrom, 2> kSources = {{{TextureFrom::kImages, "images"}, {TextureFrom::kRenders, "renders"}}};

void CheckOptions(const TextureSource& source, const TextureOptions& o) {
  const auto require = [](bool ok, const std::string& text) {
    if (!ok) throw UsageError(text);
  };
  const bool refines = o.method == TextureMethod::kRefine, renders = o.from == TextureFrom::kRenders;
  require(refines || !renders, "option 'from' renders needs option 'method' refine");
  require(refines || o.sharpen == 0, "option 'sharpen' needs option 'method' refine");
  require(o.sharpen >= 0 && o.sharpen <= 10, "option 'sharpen' must be in 0..10");
  require(o.size_px == 0 || (o.size_px >= 2 && o.size_px <= 1024), "option 'size' must be 0 or in 2..1024");
  require(o.max_px >= 64 && o.max_px <= 4096, "option 'max-px' must be in 64..4096");
  require(o.max_images >= 1 && o.max_images <= 100000, "option 'max-images' must be in 1..100000");
  require(o.views >= 1 && o.views <= 10000, "option 'views' must be in 1..10000");
  require(o.steps >= 1 && o.steps <= 100000, "option 'steps' must be in 1..100000");
  require(o.seam_price >= 0 && o.seam_price <= 100, "option 'seam-price' must be in 0..100");
  require(!renders || source.config, "option 'from' renders needs a training run as source: a body alone renders nothing new");
}

/// The views of the training images, their gains not yet taken out.
struct Images {
  std::vector<TextureView> views;
  std::vector<std::string> cameras;
};

Images ReadImages(const TextureSource& source, const avatar::SplitSide& side, int most, int max_px, const RunContext& run) {
  std::vector<std::string> missing;
  std::vector<avatar::PersonStep> steps =
      avatar::FindPersonSteps(source.data, source.person, side.cameras, side.frames, &missing);
  const auto not_posed = [&](const avatar::PersonStep& step) { return source.body.person.seen.count(step.frame) == 0; };
  steps.erase(std::remove_if(steps.begin(), steps.end(), not_posed), steps.end());
  if (steps.empty())
    throw UsageError("no frame of the " + side.kind + " in which the body was posed has an image and a mask in " +
                     source.data.root);
  Images images;
  images.views =
      ReadTextureViews(source.data, source.body.person, avatar::ThinnedSteps(steps, most), max_px, run, &images.cameras);
  return images;
}

/// Every fourth or so, of all cameras and times.
std::vector<TextureView> AQuarter(std::vector<TextureView> views, size_t cameras) {
  constexpr size_t kOneIn = 4;
  std::vector<TextureView> some;
  for (size_t i = 0; i < views.size(); ++i) {
    if ((i + i / std::max<size_t>(1, cameras)) % kOneIn == 0) some.push_back(std::move(views[i]));
  }
  return some;
}

metrics::Mask ForegroundOf(const Image& mask) {
  metrics::Mask out;
  for (const uint8_t value : mask.pixels) out.push_back(value >= 128 ? 1 : 0);
  return out;
}

TextureScore ScoreOnValidation(const TextureSource& source, const body::Textures& textures,
                               const std::vector<TextureView>& views) {
  TextureScore score;
  std::vector<metrics::ImageScore> scores;
  for (const TextureView& view : views) {
    const metrics::Mask mask = ForegroundOf(view.mask);
    if (std::count(mask.begin(), mask.end(), 1) == 0) continue;
    const body::RenderedBody seen = RenderBody(source.body.person.body, textures, view.vertices_in_world, view.camera);
    scores.push_back(
        metrics::ScoreImage(metrics::FromImage(view.image), mask, metrics::FromImage(seen.image), ForegroundOf(seen.cover)));
  }
  score.images = static_cast<int>(scores.size());
  if (scores.empty()) return score;
  const metrics::MeanScore mean = metrics::Mean(scores);
  score.psnr_db = mean.masked.psnr_db, score.ssim = mean.bbox.ssim;
  return score;
}

/// Validation images, with the body posed as in training; none where there is no validation.
std::vector<TextureView> ReadValidation(const TextureSource& source, int max_px, const RunContext& run) {
  constexpr int kMost = 48;
  if (!source.config || source.config->split.validation_cameras.empty()) return {};
  const avatar::DatasetSplit& split = source.config->split;
  const std::vector<int>& frames = split.validation_frames.empty() ? split.train_frames : split.validation_frames;
  std::vector<TextureView> views =
      ReadImages(source, {"validation", split.validation_cameras, frames}, kMost, max_px, run).views;
  for (TextureView& view : views) {
    for (size_t i = 0; i < view.image.pixels.size(); ++i)
      if (view.mask.pixels[i / 3] < 128) view.image.pixels[i] = 0;
  }
  return views;
}

void Refine(const TextureSource& source, const TextureOptions& options, const std::vector<TextureView>& views, int size_px,
            const RunContext& run, TextureResult* out) {
  body::TextureRefiner refiner(source.body.person.body, size_px);
  ProgressStage stage(run, "collecting pixels", static_cast<int64_t>(views.size()));
  for (TextureView view : views) {
    view.image = body::SharpenInMask(view.image, view.mask, options.sharpen);
    refiner.Add(view);
    stage.Advance();
  }
  body::RefineOptions refine;
  refine.steps = options.steps;
  out->refinement.emplace();
  out->textures = refiner.Refine(out->textures, refine, run, &*out->refinement);
}

/// By the training images. `out->textures` is the start of a refinement.
void MakeByImages(const TextureSource& source, const TextureOptions& options, int size_px, const RunContext& run,
                  TextureResult* out) {
  constexpr int kMedianSamples = 24, kMeanSamples = 12;
  const bool median = options.method == TextureMethod::kMedian;
  Images images = ReadImages(source, {"training", source.cameras, source.frames}, options.max_images, options.max_px, run);
  body::TextureBaker baker(source.body.person.body, size_px, median ? kMedianSamples : kMeanSamples);
  ProgressStage stage(run, "baking the texture", static_cast<int64_t>(images.views.size()));
  for (const TextureView& view : images.views) baker.Add(view, run), stage.Advance();
  const std::vector<Eigen::Array3d> gains = baker.Gains();
  for (size_t c = 0; c < images.cameras.size(); ++c) out->gains[images.cameras[c]] = gains[c];
  out->seen_share = baker.SeenShare();
  out->textures = median ? baker.FinishMedian(gains) : baker.Finish(gains);
  for (TextureView& view : images.views)
    view.image = body::WithoutGain(std::move(view.image), gains[static_cast<size_t>(view.camera_idx)]);
  if (options.method == TextureMethod::kGraphCut) {
    images.views = AQuarter(std::move(images.views), images.cameras.size());
    body::ViewChoiceOptions choose;
    choose.seam_price = options.seam_price;
    out->choice = ChooseViews(source.body.person.body, images.views, choose, run);
    out->textures = BakeChosenViews(source.body.person.body, images.views, *out->choice, size_px, options.level_seams, run);
  }
  if (options.method == TextureMethod::kRefine) Refine(source, options, images.views, size_px, run, out);
  out->images = static_cast<int>(images.views.size());
}

Json ScoreJson(const TextureScore& score) {
  return {{"images", score.images}, {"psnr_db", FiniteOrNull(score.psnr_db)}, {"ssim", FiniteOrNull(score.ssim)}};
}

}  // namespace

std::string_view ToString(TextureMethod method) { return WordOf(kMethods, method); }
std::string_view ToString(TextureFrom from) { return WordOf(kSources, from); }
void FromString(const std::string& text, TextureMethod* method) {
  *method = KnownChoice(kMethods, text, "option 'method' must be average, median, graph-cut or refine");
}
void FromString(const std::string& text, TextureFrom* from) {
  *from = KnownChoice(kSources, text, "option 'from' must be images or renders");
}

TextureResult MakeTexture(const TextureSource& source, const TextureOptions& options, const RunContext& run) {
  CheckOptions(source, options);
  const int size_px = options.size_px > 0 ? options.size_px : source.body.textures[0].width;
  TextureResult out;
  out.textures = body::ResizedTextures(source.body.textures, size_px);
  if (options.from == TextureFrom::kRenders) {
    const std::vector<TextureView> turn = RenderTurn(source, options.views, options.render_px, run);
    out.images = static_cast<int>(turn.size()), out.seen_share = std::nan("");
    Refine(source, options, turn, size_px, run, &out);
  } else {
    MakeByImages(source, options, size_px, run, &out);
  }
  const std::vector<TextureView> validation = ReadValidation(source, options.max_px, run);
  out.before = ScoreOnValidation(source, source.body.textures, validation);
  out.after = ScoreOnValidation(source, out.textures, validation);
  return out;
}

Json ToJson(const TextureResult& result) {
  Json json{{"images", result.images},
            {"chart_px", result.textures[0].width},
            {"texels_seen", FiniteOrNull(result.seen_share)},
            {"camera_gains", Json::object()},
            {"seams", nullptr},
            {"refinement", nullptr},
            {"validation", {{"before", ScoreJson(result.before)}, {"after", ScoreJson(result.after)}}}};
  for (const auto& [camera, gain] : result.gains) json["camera_gains"][camera] = {gain[0], gain[1], gain[2]};
  if (result.choice) {
    const auto energy = [](int64_t e) { return static_cast<double>(e); };
    json["seams"] = {{"views", result.choice->num_views},
                     {"length_m", result.choice->seam_m},
                     {"energy", energy(result.choice->energy)},
                     {"energy_of_best_views", energy(result.choice->energy_of_best)}};
  }
  if (result.refinement) {
    json["refinement"] = {{"pixels", result.refinement->pixels},
                          {"difference_before", FiniteOrNull(result.refinement->loss_before)},
                          {"difference", FiniteOrNull(result.refinement->loss_after)}};
  }
  return json;
}

std::string ToTable(const TextureResult& result) {
  std::string text = Format("%d images, 24 charts of %d px", result.images, result.textures[0].width);
  if (std::isfinite(result.seen_share)) text += Format(", %.0f %% of their texels seen", 100 * result.seen_share);
  text += "\n";
  if (result.choice) text += Format("%d images chosen, %.2f m of seams\n", result.choice->num_views, result.choice->seam_m);
  if (result.refinement) {
    text += Format("%lld pixels: mean difference %.2f grey levels before, %.2f after\n",
                   static_cast<long long>(result.refinement->pixels), result.refinement->loss_before,
                   result.refinement->loss_after);
  }
  if (result.after.images > 0) {
    text += Format("%d validation images: PSNR %.2f dB before, %.2f after; SSIM %.4f before, %.4f after\n", result.after.images,
                   result.before.psnr_db, result.after.psnr_db, result.before.ssim, result.after.ssim);
  }
  return text;
}

}  // namespace mvstudio::stages
