#include <cmath>

#include "core/disk/npy.h"
#include "core/disk/npy_write.h"
#include "dataset/pose/bvh_file.h"
#include "tests/fuzz/fuzz.h"

/// Motion files and numpy's arrays.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(bvh, bytes) {
  dataset::BvhClip clip;
  if (!Accepts([&] { clip = dataset::BvhFromText(std::string(bytes), "a.bvh"); })) return;
  Require(!clip.joints.empty() && clip.num_frames > 0 && clip.frame_time_s > 0, "a motion of nobody");
  Require(clip.values.size() == static_cast<size_t>(clip.num_frames) * static_cast<size_t>(clip.num_channels),
          "values of another number than frames and channels");
  size_t channels = 0;
  for (size_t j = 0; j < clip.joints.size(); ++j) {
    Require(clip.joints[j].parent < static_cast<int>(j), "a parent after its child");
    channels += clip.joints[j].channels.size();
  }
  Require(channels == static_cast<size_t>(clip.num_channels), "channels that belong to no joint");
  for (const int frame : {-1, 0, clip.num_frames - 1}) {
    Require(dataset::PlaceJoints(clip, frame).place.size() == clip.joints.size(), "a joint without a place");
  }
}

MVS_FUZZ_TARGET(npy, bytes) {
  NpyArray array;
  if (!Accepts([&] { array = ParseNpy(std::string(bytes), "a.npy"); })) return;
  size_t count = 1;
  std::vector<size_t> shape;
  for (const int64_t side : array.shape) {
    Require(side >= 0, "a negative side");
    shape.push_back(static_cast<size_t>(side));
    count *= shape.back();
  }
  Require(count == array.values.size(), "values of another number than the shape");
  NpyArray back;
  Require(Accepts([&] { back = ParseNpy(NpyOfDoubles(shape, array.values), "b.npy"); }), "what was written cannot be read");
  Require(back.shape == array.shape, "the shape changes when it is written and read");
  for (size_t i = 0; i < array.values.size(); ++i) Require(Near(back.values[i], array.values[i], 0), "a value changes");
}

}  // namespace mvstudio::fuzz
