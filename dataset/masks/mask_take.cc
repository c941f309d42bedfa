#include "dataset/masks/mask_take.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "dataset/footage/frames.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset {
namespace {

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

int MaskFrameNumber(const FrameSource::Frame& frame) {
  return static_cast<int>(std::clamp<int64_t>(frame.number, 0, std::numeric_limits<int>::max()));
}

void CountMask(const BodyMask& mask, TakeMasks* take) {
  ++take->images;
  take->empty += mask.area_fraction == 0;
  take->area_fraction_sum += mask.area_fraction;
  take->joints += mask.joints, take->joints_on_mask += mask.joints_on_mask, take->joints_supported += mask.joints_supported;
}

/// Calls `use(position, number, image)` for every frame; they must have one size and rising numbers. With `damage`, frames
/// that do not decode are left out, and it gets a line for them.
template <class Use>
int EachFrame(const std::string& path, const Use& use, std::vector<std::string>* damage = nullptr) {
  auto source = OpenFrames(path, {damage != nullptr});
  int position = 0, last = -1, width = 0, height = 0;
  while (auto frame = source->Next()) {
    const int number = MaskFrameNumber(*frame);
    if (position == 0) width = frame->rgb.width, height = frame->rgb.height;
    if (position > 0 && number <= last) RefuseOrder(source->path(), frame->label, number, last);
    if (frame->rgb.width != width || frame->rgb.height != height) {
      throw FormatError(
          source->path(), frame->label,
          "is " + SizeText(frame->rgb.width, frame->rgb.height) + ", the ones before are " + SizeText(width, height));
    }
    last = number;
    use(position, number, std::move(frame->rgb));
    ++position;
  }
  if (damage) *damage = source->Damage();
  if (position == 0) throw FormatError(path, "", "holds no image" + std::string(damage ? " that decodes; copy it again" : ""));
  return position;
}

Image AtLeast(const Image& grey, int level) {
  Image out = grey;
  for (uint8_t& v : out.pixels) v = v >= level ? 255 : 0;
  return out;
}

int MarginPx(const FootageSamples& samples) { return std::max(2, std::max(samples.width, samples.height) / 120); }

/// Two rounds: a rough idea of who is where, then the masks that follow from it.
CameraMaskModel LearnFromRough(const FootageSamples& samples, const std::vector<Image>& surely, const std::vector<Image>& maybe,
                               const std::vector<Image>& probability, const Image* plate, const MaskOptions& options) {
  const CameraMaskModel first = LearnCameraFromMasks(samples.frames, surely, maybe, plate, options);
  std::vector<Image> masks, around;
  for (size_t f = 0; f < samples.frames.size(); ++f) {
    MaskHints hints;
    if (!probability.empty()) hints.probability = &probability[f];
    masks.push_back(SegmentPeople(samples.frames[f], hints, first, options).mask);
    around.push_back(internal::Dilated(masks.back(), MarginPx(samples)));
  }
  return LearnCameraFromMasks(samples.frames, masks, around, plate, options);
}

LearnedCamera LearnFromNet(const FootageSamples& samples, const PersonNet& net, const Image* plate,
                           const MaskOptions& options) {
  std::vector<Image> probability, surely, maybe;
  bool anybody = false;
  for (const Image& frame : samples.frames) {
    probability.push_back(net(frame, nullptr));
    surely.push_back(AtLeast(probability.back(), 200));
    maybe.push_back(internal::Dilated(AtLeast(probability.back(), 64), 2 * MarginPx(samples)));
    anybody = anybody || std::any_of(surely.back().pixels.begin(), surely.back().pixels.end(), [](uint8_t v) { return v; });
  }
  if (!anybody) return {Status::kDegenerate, {}};
  return {Status::kOk, LearnFromRough(samples, surely, maybe, probability, plate, options)};
}

LearnedCamera LearnFromMotion(const FootageSamples& samples, const Image* plate, const MaskOptions& options) {
  const MotionModel motion = FindMotion(samples.frames, plate, options);
  if (motion.status != Status::kOk) return {motion.status, {}};
  std::vector<Image> maybe;
  for (const Image& moving : motion.moving) maybe.push_back(internal::Dilated(moving, MarginPx(samples)));
  return {Status::kOk, LearnFromRough(samples, motion.moving, maybe, {}, plate, options)};
}

}  // namespace

const ProjectedBody* BodiesOfTake::At(int frame) const {
  const auto found = frames.find(frame);
  return found == frames.end() ? nullptr : &found->second;
}

FootageSamples SampleFootage(const std::string& path, int count, bool keep_undamaged) {
  FootageSamples samples;
  std::vector<std::string>* const damage = keep_undamaged ? &samples.damage : nullptr;
  int64_t total = OpenFrames(path, {keep_undamaged})->num_frames();
  if (total <= 0)
    total = EachFrame(
        path, [](int, int, Image) {}, damage);
  const int64_t k = std::clamp<int64_t>(count, 1, total);
  std::vector<int64_t> wanted;
  for (int64_t i = 0; i < k; ++i) wanted.push_back((2 * i + 1) * total / (2 * k));
  const auto take = [&](int position, int number, Image rgb) {
    samples.width = rgb.width, samples.height = rgb.height;
    samples.all.push_back(number);
    // The last resort is for footage whose header promised more frames than it holds.
    if (!std::binary_search(wanted.begin(), wanted.end(), position) && !(position == 0 && total > 2 * k)) return;
    samples.numbers.push_back(number);
    samples.frames.push_back(std::move(rgb));
  };
  samples.num_frames = EachFrame(path, take, damage);
  return samples;
}

LearnedCamera LearnTakeCamera(const FootageSamples& samples, const BodiesOfTake& bodies, const PersonNet& net,
                              const Image* plate, const MaskOptions& options) {
  MVS_CHECK(!samples.frames.empty(), "nothing to learn from");
  std::vector<Image> frames;
  std::vector<ProjectedBody> of_frames;
  bool anybody = false;
  for (size_t f = 0; f < samples.frames.size(); ++f) {
    const ProjectedBody* body = bodies.At(samples.numbers[f]);
    if (!body) continue;  // somebody may be there all the same
    frames.push_back(samples.frames[f]);
    of_frames.push_back(*body);
    anybody = anybody || !body->empty();
  }
  if (anybody) return {Status::kOk, LearnCamera(frames, of_frames, plate, options)};
  if (net) return LearnFromNet(samples, net, plate, options);
  return LearnFromMotion(samples, plate, options);
}

void Flicker::Add(const Image& rgb_before, const Image& mask_before, const Image& rgb, const Image& mask) {
  constexpr double kSame = 6;  // grey levels
  cv::Mat step, channels[3];
  cv::absdiff(internal::View(rgb), internal::View(rgb_before), step);
  cv::split(step, channels);
  cv::max(channels[0], channels[1], step), cv::max(step, channels[2], step);
  cv::dilate(step, step, cv::Mat());
  const cv::Mat same = step <= kSame, rotated = internal::View(mask) != internal::View(mask_before);
  unmoving_px += cv::countNonZero(same);
  changed_px += cv::countNonZero(same & rotated);
}

void TakeMasks::Add(const TakeMasks& more) {
  images += more.images, empty += more.empty;
  area_fraction_sum += more.area_fraction_sum, seconds += more.seconds;
  joints += more.joints, joints_on_mask += more.joints_on_mask, joints_supported += more.joints_supported;
  flicker.unmoving_px += more.flicker.unmoving_px, flicker.changed_px += more.flicker.changed_px;
}

TakeSegmenter::TakeSegmenter(const std::string& path, const SegmentTools& tools, bool keep_undamaged)
    : tools_(tools), source_(OpenFrames(path, {keep_undamaged, false, false, true})) {}

TakeSegmenter::~TakeSegmenter() = default;

int64_t TakeSegmenter::Segment(int64_t first, int64_t end, const std::function<void(int, const Image&, const BodyMask&)>& use,
                               TakeMasks* take) {
  Image previous_rgb, previous_mask;
  while (position_ < end) {
    const auto frame = source_->Advance();
    if (!frame) break;
    if (position_++ < first) continue;
    const int number = MaskFrameNumber(*frame);
    if (tools_.only && tools_.only->count(number) == 0) continue;
    Image rgb = source_->FullImage();
    const Stopwatch watch;
    MaskHints hints;
    hints.body = tools_.bodies->At(number);
    const Image probability = tools_.net ? tools_.net(rgb, hints.body) : Image();
    const Image room = tools_.possible ? tools_.possible(number) : Image();
    if (!probability.empty()) hints.probability = &probability;
    if (!room.empty()) hints.possible = &room;
    if (!previous_rgb.empty()) hints.previous_rgb = &previous_rgb, hints.previous_mask = &previous_mask;
    BodyMask mask = SegmentPeople(rgb, hints, *tools_.model, *tools_.options);
    take->seconds += watch.Seconds();
    if (!previous_rgb.empty()) take->flicker.Add(previous_rgb, previous_mask, rgb, mask.mask);
    use(number, rgb, mask);
    CountMask(mask, take);
    previous_rgb = std::move(rgb), previous_mask = std::move(mask.mask);
  }
  return std::max<int64_t>(0, position_ - first);
}

}  // namespace mvstudio::dataset
