#include "stages/view/frame_store.h"

#include "dataset/footage/image_io.h"
#include "stages/view/scene_parts.h"

namespace mvstudio::stages {
namespace {

constexpr int kWholeQuality = 92, kSmallQuality = 75;

}  // namespace

FrameStore::Opened& FrameStore::Open(const std::string& footage) {
  const auto known = opened_.find(footage);
  if (known != opened_.end()) return known->second;
  Opened opened;
  opened.files = dataset::ListFootage(footage);
  for (size_t i = 0; !opened.files.is_video && i < opened.files.paths.size(); ++i)
    opened.images.emplace(opened.files.images.numbers[i], opened.files.paths[i]);
  return opened_.emplace(footage, std::move(opened)).first->second;
}

Image FrameStore::ReadVideo(const std::string& footage, int64_t number, Opened* opened) {
  for (const std::string& path : opened->files.paths) RequireInside(path, root_);
  if (!opened->source || opened->at >= number) {
    opened->source = dataset::OpenFrames(footage, {false, true, false, true});
    opened->at = -1;
  }
  while (const auto frame = opened->source->Advance()) {
    opened->at = frame->number;
    if (frame->number >= number) return frame->number == number ? opened->source->FullImage() : Image();
  }
  opened->source.reset();
  return {};
}

Image FrameStore::Read(const std::string& footage, int64_t number) {
  if (footage.empty() || number < 0) return {};
  Opened& opened = Open(footage);
  if (opened.files.is_video) return ReadVideo(footage, number, &opened);
  const auto file = opened.images.find(number);
  if (file == opened.images.end()) return {};
  RequireInside(file->second, root_);
  return dataset::ReadImage(file->second);
}

const std::string& FrameStore::Jpeg(const std::string& footage, int64_t number, int longer_side_px) {
  const Key key{footage, number, longer_side_px};
  const auto known = kept_.find(key);
  if (known != kept_.end()) {
    order_.splice(order_.begin(), order_, known->second.place);
    return known->second.jpeg;
  }
  Image image = Read(footage, number);
  if (!image.empty() && longer_side_px > 0) image = dataset::Reduced(image, longer_side_px);
  std::string jpeg;
  if (!image.empty()) jpeg = dataset::EncodeImage(image, "frame.jpg", longer_side_px > 0 ? kSmallQuality : kWholeQuality);
  bytes_ += jpeg.size();
  order_.push_front(key);
  Kept& kept = kept_[key] = {std::move(jpeg), order_.begin()};
  MakeRoom();
  return kept.jpeg;
}

/// The last one stays, however large it is.
void FrameStore::MakeRoom() {
  while (bytes_ > most_bytes_ && order_.size() > 1) {
    const auto oldest = kept_.find(order_.back());
    bytes_ -= oldest->second.jpeg.size();
    kept_.erase(oldest);
    order_.pop_back();
  }
}

}  // namespace mvstudio::stages
