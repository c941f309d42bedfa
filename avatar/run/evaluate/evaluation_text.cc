#include <cmath>
#include <nlohmann/json.hpp>

#include "avatar/run/evaluate/evaluate.h"
#include "core/format.h"

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

Json DistanceJson(const Evaluation& e, const std::optional<SetDistance>& distance) {
  if (!distance) return nullptr;
  return {{"value", Finite(distance->fd)},
          {"name", e.distance_name},
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

Json ScoredJson(const Evaluation& e, const Scored& scored) {
  Json json = MeanJson(scored.mean);
  if (!e.lpips.name.empty()) json["lpips"] = Finite(scored.lpips);
  json["fd"] = DistanceJson(e, scored.fd);
  return json;
}

Json IntervalJson(const metrics::Interval& interval) { return {Finite(interval.low), Finite(interval.high)}; }

/// `ssim_ci95` beside `ssim`, `full.psnr_db` within `full`.
void AddIntervals(const std::map<std::string, metrics::Interval>& intervals, Json* json) {
  for (const auto& [key, interval] : intervals) {
    const size_t dot = key.find('.');
    Json& place = dot == std::string::npos ? *json : (*json)[key.substr(0, dot)];
    place[(dot == std::string::npos ? key : key.substr(dot + 1)) + "_ci95"] = IntervalJson(interval);
  }
}

Json GroupJson(const Evaluation& e, const GroupScore& group) {
  Json row = MeanJson(group.mean);
  if (!e.lpips.name.empty()) row["lpips"] = Finite(group.lpips);
  row["flicker"] = Finite(group.flicker);
  row["ssim_ci95"] = IntervalJson(group.ssim_interval);
  return row;
}

Json NetJson(const ProtocolNet& net) { return {{"name", net.name}, {"sha256", net.sha256}}; }

Json TrainingJson(const Evaluation& e) {
  Json options = Json::object();
  for (const auto& [key, value] : e.training) options[key] = value;
  return {{"num_parameters", e.num_parameters},
          {"size_px", e.config.pack.size_px},
          {"cameras", e.config.split.train_cameras},
          {"num_frames", e.config.split.train_frames.size()},
          {"options", options}};
}

std::string Row(const std::string& name, const Scored& scored) {
  const std::string fd = scored.fd ? Format("%.4g", scored.fd->fd) : "-";
  return Format("  %-38s %5lld  %.4f  %6.2f  %.4f  %.4f  %6.2f  %s\n", name.c_str(), static_cast<long long>(scored.mean.n),
                scored.mean.bbox.ssim, scored.mean.bbox.psnr_db, scored.mean.mask_iou, scored.mean.full.ssim,
                scored.mean.full.psnr_db, fd.c_str());
}

}  // namespace

std::string ToJsonText(const Evaluation& e) {
  Json json;
  json["holdout"] = ScoredJson(e, e.holdout);
  json["holdout"]["kind"] = e.holdout_kind;
  json["holdout"]["flicker"] = Finite(e.flicker);
  AddIntervals(e.intervals, &json["holdout"]);
  json["baselines"] = {{"mean_image", ScoredJson(e, e.mean_image)}, {"nearest_pose", ScoredJson(e, e.nearest_pose)}};
  if (e.body_alone) json["baselines"]["body_alone"] = ScoredJson(e, *e.body_alone);
  if (e.body_by_joints) json["baselines"]["body_by_joints"] = ScoredJson(e, *e.body_by_joints);
  if (e.template_alone) json["baselines"]["template_alone"] = ScoredJson(e, *e.template_alone);
  json["per_camera"] = json["per_motion"] = Json::array();
  for (const GroupScore& camera : e.per_camera) {
    Json row = {{"name", camera.name}, {"nearest_camera", e.nearest_camera.at(camera.name)}};
    row.update(GroupJson(e, camera));
    json["per_camera"].push_back(row);
  }
  for (const GroupScore& motion : e.per_motion) {
    Json row = {{"name", motion.name}};
    row.update(GroupJson(e, motion));
    json["per_motion"].push_back(row);
  }
  json["other_splits"] = Json::object();
  for (const auto& [kind, scored] : e.other_splits) json["other_splits"][kind] = ScoredJson(e, scored);
  json["pictures"] = Json::array();
  for (const ImageStrip& strip : e.strips) {
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
  json["missing"] = Json::parse(dataset::MissingToJsonText(e.missing));
  json["frames_without_person"] = e.frames_without_person;
  json["size_px"] = e.size_px;
  json["px_per_m"] = e.config.pack.fill * e.size_px / 2 / e.config.half_extent_m;
  json["template_iou"] = Finite(e.config.template_iou);
  json["checkpoint_step"] = e.checkpoint_step;
  json["seconds_per_frame"] = Finite(e.seconds_per_image);
  json["training"] = TrainingJson(e);
  json["features"] = NetJson(e.features);
  json["lpips_net"] = e.lpips.name.empty() ? Json() : NetJson(e.lpips);
  json["protocol_sha256"] = e.protocol.sha256;
  json["convention"] = e.convention;
  return json.dump();
}

std::string ToTable(const Evaluation& e) {
  std::string text = "Scored on " + e.holdout_kind + ", " + std::to_string(e.size_px) + " px, step " +
                     std::to_string(e.checkpoint_step) + ", protocol " + e.protocol.sha256.substr(0, 12) + "\n";
  text += "                                             n    SSIM    PSNR     IoU  full: SSIM  PSNR  " + e.distance_name + "\n";
  text += Row("avatar", e.holdout) + Row("baseline: mean image of nearest camera", e.mean_image) +
          Row("baseline: nearest pose", e.nearest_pose);
  if (e.body_alone) text += Row("no network: the fitted body", *e.body_alone);
  if (e.body_by_joints) text += Row("no network: the same posed by joints alone", *e.body_by_joints);
  if (e.template_alone) text += Row("no network: its textures on the template", *e.template_alone);
  for (const auto& [kind, scored] : e.other_splits) text += Row(kind, scored);
  for (const GroupScore& camera : e.per_camera) text += Row("held-out camera " + camera.name, {camera.mean, {}, camera.lpips});
  if (e.per_motion.size() > 1) {
    for (const GroupScore& motion : e.per_motion) text += Row("motion " + motion.name, {motion.mean, {}, motion.lpips});
  }
  const metrics::Interval &ssim = e.intervals.at("ssim"), &psnr = e.intervals.at("psnr_db");
  text += std::isfinite(ssim.low) ? Format("  95 %% intervals over blocks of frames: SSIM %.4f to %.4f, PSNR %.2f to %.2f dB",
                                           ssim.low, ssim.high, psnr.low, psnr.high)
                                  : "  no intervals: a single held-out frame shows no spread";
  text += Format("\n  outlines F %.4f, flicker %.4f, masked: SSIM %.4f, PSNR %.2f dB", e.holdout.mean.boundary_f, e.flicker,
                 e.holdout.mean.masked.ssim, e.holdout.mean.masked.psnr_db);
  if (!e.lpips.name.empty()) text += "\n  LPIPS (" + e.lpips.name + ") " + std::to_string(e.holdout.lpips);
  if (e.holdout.fd) {
    text += Format("\n  %s between halves of the truth: %.4g; kernel distance %.3g +- %.2g", e.distance_name.c_str(),
                   e.holdout.fd->floor, e.holdout.fd->kid.value, e.holdout.fd->kid.standard_error);
  }
  return text;
}

}  // namespace mvstudio::avatar
