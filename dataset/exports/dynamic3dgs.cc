#include <nlohmann/json.hpp>

#include "calib/board/pixel_origin.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/exports/writers.h"

/// Dynamic 3D Gaussians (Luiten et al., 3DV 2024): train_meta.json, test_meta.json, ims/, seg/ (0 and 1) and init_pt_cld.npz.
/// Its rasteriser puts the centre of the top-left pixel at (0.5, 0.5) of `k`.
namespace mvstudio::exports {
namespace {

using Json = nlohmann::ordered_json;

Json Rows(const std::vector<double>& values, size_t columns) {
  Json rows = Json::array();
  for (size_t i = 0; i < values.size(); i += columns) {
    rows.push_back(std::vector<double>(values.begin() + static_cast<std::ptrdiff_t>(i),
                                       values.begin() + static_cast<std::ptrdiff_t>(i + columns)));
  }
  return rows;
}

/// Cameras that have an image in a frame, for each frame.
Json Meta(const Take& take, const std::vector<size_t>& views, const std::map<std::pair<size_t, int>, std::string>& files) {
  const geometry::Camera& first = take.views[0].camera.camera;
  Json meta = {{"w", first.width_px}, {"h", first.height_px}};
  for (const char* key : {"k", "w2c", "fn", "cam_id"}) meta[key] = Json::array();
  for (const int frame : take.frames) {
    Json k = Json::array(), w2c = Json::array(), fn = Json::array(), ids = Json::array();
    for (const size_t i : views) {
      const auto found = files.find({i, frame});
      if (found == files.end()) continue;
      k.push_back(Rows(MatrixOf(take.views[i].camera.camera, calib::kCornerOriginShiftPx), 3));
      w2c.push_back(Rows(RowsOf(take.views[i].camera.cam_from_world), 4));
      fn.push_back(found->second);
      ids.push_back(i);
    }
    meta["k"].push_back(k), meta["w2c"].push_back(w2c), meta["fn"].push_back(fn), meta["cam_id"].push_back(ids);
  }
  return meta;
}

std::string InitialPoints(const Job& job) {
  std::vector<double> rows;
  for (const int frame : job.take.frames) {
    for (const StartPoint& point : StartPoints(job, frame)) {
      for (int k = 0; k < 3; ++k) rows.push_back(point.x_in_world[k]);
      for (const uint8_t channel : point.rgb) rows.push_back(channel / 255.0);
      rows.push_back(1);  // foreground
    }
    break;  // the reconstruction starts at the first frame
  }
  return NpzOf({{"data", NpyOfDoubles({rows.size() / 7, 7}, rows)}});
}

void NoteNearCameras(const Job& job) {
  constexpr double kNearM = 1.0;  // near plane of its train.py
  int near = 0;
  for (const View& view : job.take.views) {
    for (const auto& [id, pose] : job.take.At(job.take.frames.front())) {
      for (int j = 0; j < 19; ++j) {
        const double z = (view.camera.cam_from_world * Eigen::Vector3d(pose.x_in_world.col(j))).z();
        if (pose.valid[j] && z > 0 && z < kNearM) {
          ++near;
          break;
        }
      }
    }
  }
  if (near == 0) return;
  job.report->notes.push_back(
      {"EXP-NEAR",
       "people come nearer than 1 m to " + std::to_string(near) + " cameras, which is where Dynamic 3D Gaussians stops drawing",
       "lower NEAR in its train.py"});
}

}  // namespace

void WriteDynamic3dgs(const Job& job) {
  const Take& take = job.take;
  std::map<std::pair<size_t, int>, std::string> files;
  for (const int frame : take.frames) {
    for (size_t i = 0; i < take.views.size(); ++i) {
      const std::string stem = Numbered(take.views[i].info.name + "/", frame, 6, "");
      const std::string file = job.images.AddImage(i, frame, "ims/" + stem);
      if (file.empty() && job.options.images != ExportImages::kNone) continue;
      files[{i, frame}] = file.empty() ? stem + ".jpg" : file.substr(4);
      job.images.AddMask(i, frame, "seg/" + stem + ".png", Images::MaskValues::k1);
    }
  }
  job.Write("train_meta.json", Meta(take, take.ViewsOf(dataset::PartOfSplit::kTrain), files).dump() + "\n");
  job.Write("test_meta.json", Meta(take, take.ViewsOf(dataset::PartOfSplit::kTest), files).dump() + "\n");
  job.Write("init_pt_cld.npz", InitialPoints(job));
  NoteNearCameras(job);
}

}  // namespace mvstudio::exports
