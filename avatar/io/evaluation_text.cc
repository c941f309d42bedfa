#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "avatar/io/evaluate.h"

namespace mvstudio::avatar {
namespace {

using metrics::MeanScore;
using metrics::RegionScore;
using Json = nlohmann::ordered_json;

Json Finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json RegionJson(const RegionScore& score) {
  return {{"ssim", Finite(score.ssim)},
          {"ssim_luma", Finite(score.ssim_luma)},
          {"ssim_skimage", Finite(score.ssim_skimage)},
          {"psnr_db", Finite(score.psnr_db)}};
}

Json DistanceJson(const std::optional<SetDistance>& distance) {
  if (!distance) return nullptr;
  return {{"value", Finite(distance->fd)},
          {"features", distance->features},
          {"n", distance->n},
          {"d", distance->d},
          {"floor", Finite(distance->floor)},
          {"kid", Finite(distance->kid.value)},
          {"kid_se", Finite(distance->kid.standard_error)}};
}

Json MeanJson(const MeanScore& mean) {
  return {{"n", mean.n},
          {"ssim", Finite(mean.bbox.ssim)},
          {"psnr_db", Finite(mean.bbox.psnr_db)},
          {"mask_iou", Finite(mean.mask_iou)},
          {"ssim_luma", Finite(mean.bbox.ssim_luma)},
          {"ssim_skimage", Finite(mean.bbox.ssim_skimage)},
          {"boundary_f", Finite(mean.boundary_f)},
          {"psnr_infinite", mean.psnr_infinite},
          {"full", RegionJson(mean.full)},
          {"masked", RegionJson(mean.masked)}};
}

Json ScoredJson(const Scored& scored) {
  Json json = MeanJson(scored.mean);
  json["fd"] = DistanceJson(scored.fd);
  return json;
}

std::string Row(const std::string& name, const Scored& scored) {
  char line[240];
  const std::string fd = scored.fd ? std::to_string(scored.fd->fd).substr(0, 6) : "-";
  std::snprintf(line, sizeof line, "  %-38s %5lld  %.4f  %6.2f  %.4f  %.4f  %6.2f  %s\n", name.c_str(),
                static_cast<long long>(scored.mean.n), scored.mean.bbox.ssim, scored.mean.bbox.psnr_db, scored.mean.mask_iou,
                scored.mean.full.ssim, scored.mean.full.psnr_db, fd.c_str());
  return line;
}

}  // namespace

std::string ToJsonText(const Evaluation& e) {
  Json json;
  json["holdout"] = ScoredJson(e.holdout);
  json["holdout"]["kind"] = e.holdout_kind;
  json["holdout"]["ssim_ci95"] = {Finite(e.ssim_interval.low), Finite(e.ssim_interval.high)};
  json["holdout"]["psnr_db_ci95"] = {Finite(e.psnr_interval.low), Finite(e.psnr_interval.high)};
  json["holdout"]["flicker"] = Finite(e.flicker);
  json["baselines"] = {{"mean_image", ScoredJson(e.mean_image)}, {"nearest_pose", ScoredJson(e.nearest_pose)}};
  json["per_camera"] = Json::array();
  for (const CameraScore& camera : e.per_camera) {
    Json row = {{"name", camera.name}, {"nearest_camera", camera.nearest_camera}};
    row.update(MeanJson(camera.mean));
    json["per_camera"].push_back(row);
  }
  json["other_splits"] = Json::object();
  for (const auto& [kind, scored] : e.other_splits) json["other_splits"][kind] = ScoredJson(scored);
  json["pictures"] = Json::array();
  for (const PictureStrip& strip : e.strips) {
    json["pictures"].push_back({{"path", strip.path},
                                {"camera", strip.camera},
                                {"frame", strip.frame},
                                {"ssim", Finite(strip.ssim)},
                                {"psnr_db", Finite(strip.psnr_db)},
                                {"panels", {"truth", "render", "error", "nearest_pose"}}});
  }
  const DatasetSplit& split = e.config.split;
  json["split"] = {{"train_cameras", split.train_cameras},
                   {"holdout_cameras", split.holdout_cameras},
                   {"num_train_frames", split.train_frames.size()},
                   {"holdout_frames", split.holdout_frames}};
  json["skipped"] = e.skipped;
  json["size_px"] = e.config.pack.size_px;
  json["px_per_m"] = e.config.pack.fill * e.config.pack.size_px / 2 / e.config.half_extent_m;
  json["template_iou"] = Finite(e.config.template_iou);
  json["checkpoint_step"] = e.checkpoint_step;
  json["seconds_per_frame"] = Finite(e.seconds_per_picture);
  json["convention"] = e.convention;
  return json.dump();
}

std::string ToTable(const Evaluation& e) {
  std::string text = "Scored on " + e.holdout_kind + ", " + std::to_string(e.config.pack.size_px) + " px, step " +
                     std::to_string(e.checkpoint_step) + "\n";
  text += "                                             n    SSIM    PSNR     IoU  full: SSIM  PSNR  FD\n";
  text += Row("avatar", e.holdout) + Row("baseline: mean image of nearest camera", e.mean_image) +
          Row("baseline: nearest pose", e.nearest_pose);
  for (const auto& [kind, scored] : e.other_splits) text += Row(kind, scored);
  char line[200];
  std::snprintf(line, sizeof line, "  95 %% intervals over blocks of frames: SSIM %.4f to %.4f, PSNR %.2f to %.2f dB",
                e.ssim_interval.low, e.ssim_interval.high, e.psnr_interval.low, e.psnr_interval.high);
  text += line;
  if (e.holdout.fd) {
    std::snprintf(line, sizeof line, "\n  FD (%s) between halves of the truth: %.4g; kernel distance %.3g +- %.2g",
                  e.holdout.fd->features.c_str(), e.holdout.fd->floor, e.holdout.fd->kid.value,
                  e.holdout.fd->kid.standard_error);
    text += line;
  }
  return text;
}

}  // namespace mvstudio::avatar
