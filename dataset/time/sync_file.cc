#include "dataset/time/sync_file.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "dataset/json/json_file.h"

namespace mvstudio::dataset {
namespace {

constexpr char kSchema[] = "mvstudio.sync/1", kSchemaOfRates[] = "mvstudio.sync/2";
constexpr double kMaxOffsetFrames = 1e6, kMaxRatePpm = 1e5, kMaxRate = 1000;

SyncedCamera ReadCamera(const internal::JsonView& json) {
  SyncedCamera camera;
  camera.name = internal::CameraName(json["name"]);
  camera.status = json["status"].Text();
  if (camera.status != "Ok") return camera;
  camera.offset_frames = json["offset_frames"].Number();
  camera.sigma_frames = json["sigma_frames"].Number();
  if (std::abs(*camera.offset_frames) > kMaxOffsetFrames) json["offset_frames"].Fail("must lie within 1e6 frames");
  if (camera.sigma_frames < 0) json["sigma_frames"].Fail("must not be negative");
  if (json.Has("nominal_rate")) camera.nominal_rate = json["nominal_rate"].Number();
  if (!(camera.nominal_rate >= 1 / kMaxRate && camera.nominal_rate <= kMaxRate))
    json["nominal_rate"].Fail("must lie in 0.001 to 1000, frames of this camera for one of the reference");
  if (json.Has("rate_ppm")) camera.rate_ppm = json["rate_ppm"].Number();
  if (std::abs(camera.rate_ppm) > kMaxRatePpm) json["rate_ppm"].Fail("must lie within 1e5");
  return camera;
}

}  // namespace

void WriteSync(const SyncFile& sync, const std::string& path) {
  const bool rates = std::any_of(sync.cameras.begin(), sync.cameras.end(),
                                 [](const SyncedCamera& camera) { return camera.offset_frames && camera.nominal_rate != 1; });
  internal::Json json{{"schema", rates ? kSchemaOfRates : kSchema},
                      {"reference", sync.reference},
                      {"fps", nullptr},
                      {"cameras", internal::Json::array()}};
  if (sync.fps) json["fps"] = *sync.fps;
  for (const SyncedCamera& camera : sync.cameras) {
    MVS_CHECK(std::isfinite(camera.offset_frames.value_or(0)) && std::isfinite(camera.sigma_frames) &&
                  std::isfinite(camera.rate_ppm) && std::isfinite(camera.nominal_rate),
              camera.name << " has an offset that is not finite");
    MVS_CHECK((camera.status == "Ok") == camera.offset_frames.has_value(), camera.name << ": " << camera.status);
    internal::Json entry{
        {"name", camera.name}, {"status", camera.status}, {"offset_frames", nullptr}, {"sigma_frames", nullptr}};
    if (camera.offset_frames) {
      entry["offset_frames"] = *camera.offset_frames;
      entry["sigma_frames"] = camera.sigma_frames;
      if (camera.nominal_rate != 1) entry["nominal_rate"] = camera.nominal_rate;
      if (camera.rate_ppm != 0) entry["rate_ppm"] = camera.rate_ppm;
      if (sync.fps) entry["offset_ms"] = 1000 * *camera.offset_frames / camera.nominal_rate / *sync.fps;
    }
    json["cameras"].push_back(entry);
  }
  WriteFileAtomic(path, json.dump(2) + "\n");
}

SyncFile ReadSync(const std::string& path) {
  const internal::Json json = internal::ParseJsonFile(path);
  const internal::JsonView view(path, json);
  const std::string schema = view["schema"].Text();
  if (schema != kSchema && schema != kSchemaOfRates)
    view["schema"].Fail(std::string("must be ") + kSchema + " or " + kSchemaOfRates);
  SyncFile sync;
  sync.reference = view["reference"].Text();
  if (view.Has("fps") && !json["fps"].is_null()) {
    sync.fps = view["fps"].Number();
    if (!(*sync.fps > 1e-3 && *sync.fps < 1e6)) view["fps"].Fail("must be positive, frames a second");
  }
  const internal::JsonView cameras = view["cameras"];
  std::set<std::string> names;
  for (size_t i = 0; i < cameras.ArraySize(); ++i) {
    sync.cameras.push_back(ReadCamera(cameras[i]));
    if (!names.insert(sync.cameras.back().name).second) cameras[i]["name"].Fail("is there twice");
  }
  if (names.count(sync.reference) == 0) view["reference"].Fail("is none of the cameras");
  return sync;
}

std::vector<double> OffsetsOf(const SyncFile& sync, const std::vector<std::string>& names) {
  std::vector<double> offsets;
  for (const std::string& name : names) {
    offsets.push_back(std::nan(""));
    for (const SyncedCamera& camera : sync.cameras) {
      if (camera.name == name && camera.offset_frames) offsets.back() = *camera.offset_frames;
    }
  }
  return offsets;
}

std::vector<double> RatesOf(const SyncFile& sync, const std::vector<std::string>& names) {
  std::vector<double> rates;
  for (const std::string& name : names) {
    rates.push_back(1);
    for (const SyncedCamera& camera : sync.cameras) {
      if (camera.name == name) rates.back() = camera.nominal_rate / (1 + 1e-6 * camera.rate_ppm);
    }
  }
  return rates;
}

}  // namespace mvstudio::dataset
