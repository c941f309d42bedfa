#include "avatar/run/evaluate/evaluation_protocol.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "core/hash/sha256.h"

namespace mvstudio::avatar {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

std::string NameAndDigest(const std::string& path) { return fs::path(path).filename().string() + " " + Sha256File(path); }

/// Of the list of images with the names and contents of their files.
std::string DigestOfImages(const dataset::PanopticDataset& data, const ProtocolSplit& split) {
  Sha256 digest;
  for (const auto& [camera, frame] : split.images) {
    const std::string line =
        NameAndDigest(data.ImagePath(camera, frame)) + " " + NameAndDigest(data.MaskPath(camera, frame)) + "\n";
    digest.Update(line.data(), line.size());
  }
  return digest.HexDigest();
}

std::string DigestOfJoints(const dataset::PanopticDataset& data, int person, const std::set<int>& frames) {
  Sha256 digest;
  for (const int frame : frames) {
    const dataset::Coco19Pose& pose = data.poses.at(frame).at(person);
    digest.Update(&frame, sizeof frame);
    digest.Update(pose.x_in_world.data(), sizeof(double) * static_cast<size_t>(pose.x_in_world.size()));
    for (const bool valid : pose.valid) {
      const char byte = valid ? 1 : 0;
      digest.Update(&byte, 1);
    }
  }
  return digest.HexDigest();
}

Json NetJson(const ProtocolNet& net) {
  if (net.name.empty()) return nullptr;
  return {{"name", net.name}, {"sha256", net.sha256.empty() ? Json() : Json(net.sha256)}};
}

/// The settings of the scores; a change of any of them is a new version.
Json MetricsJson() {
  return {{"version", 1},
          {"regions", "bounding box of the true mask + 5 % of its longer side (primary), whole crop, pixels of the true mask"},
          {"levels", "8-bit sRGB, RGB in [0, 1]"},
          {"ssim", "Wang 2004: Gaussian 11x11, sigma 1.5, K 0.01 0.03, L 1, population covariance, valid windows, mean of RGB"},
          {"psnr", "mean of the decibels, infinite ones left out"},
          {"mask", "predicted at 0.5; outlines within 0.8 % of the diagonal, at least 1 px"},
          {"distance", "Frechet, covariances with n - 1, of whole crops"}};
}

Json Body(const ProtocolInput& input) {
  const RunConfig& config = input.config;
  std::vector<std::string> cameras;
  std::set<int> frames;
  for (const auto& [camera, frame] : input.holdout.images) {
    if (std::find(cameras.begin(), cameras.end(), camera) == cameras.end()) cameras.push_back(camera);
    frames.insert(frame);
  }
  return {{"holdout", {{"kind", input.holdout.kind}, {"cameras", cameras}, {"frames", frames}}},
          {"crop",
           {{"size_px", input.size_px},
            {"half_extent_m", config.half_extent_m},
            {"fill", config.pack.fill},
            {"person", config.pack.person},
            {"rule", "pinhole at the camera's place, turned to the middle of the joints; a metre has one size"}}},
          {"background", "black; truth behind the dataset's mask, render behind its own"},
          {"features", NetJson(input.features)},
          {"lpips", NetJson(input.lpips)},
          {"metrics", MetricsJson()},
          {"dataset",
           {{"pictures", input.holdout.images.size()},
            {"pictures_sha256", DigestOfImages(*input.data, input.holdout)},
            {"joints_sha256", DigestOfJoints(*input.data, config.pack.person, frames)},
            {"calibration_sha256", Sha256File(dataset::FindPanopticCalibration(input.data->root))}}}};
}

}  // namespace

EvaluationProtocol MakeProtocol(const ProtocolInput& input) {
  const Json body = Body(input);
  const std::string canonical = nlohmann::json::parse(body.dump()).dump();
  EvaluationProtocol protocol;
  protocol.sha256 = Sha256Hex(canonical.data(), canonical.size());
  Json splits = Json::object();
  for (const ProtocolSplit& split : input.other_splits)
    splits[split.kind] = {{"pictures", split.images.size()}, {"sha256", DigestOfImages(*input.data, split)}};
  const Json json = {{"schema", kProtocolSchema}, {"sha256", protocol.sha256}, {"protocol", body}, {"splits", splits}};
  protocol.json_text = json.dump(1) + "\n";
  return protocol;
}

}  // namespace mvstudio::avatar
