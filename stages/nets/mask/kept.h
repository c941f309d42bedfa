#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/input/kept_footage.h"
#include "stages/nets/mask/make.h"

/// What is kept of masks until a run that was cut is done again: samples, what is learned from them, the choice of a backend,
/// and masks by blocks of frames. All of it is removed when the masks are there.
namespace mvstudio::stages {

inline constexpr char kSamplesKind[] = "samples", kModelsKind[] = "mask-models", kChoiceOfMasksKind[] = "mask-choices",
                      kMasksKind[] = "masks";

struct MaskBlock {
  struct Frame {
    int number = 0;
    std::string mask, soft;  ///< bytes of the files; `soft` may be empty
    Image tile;              ///< of the contact sheet; may be empty
  };
  std::vector<Frame> frames;
  dataset::TakeMasks take;
  int64_t positions = 0;  ///< frames of the footage; less than kKeptBlock: it ended
};

/// Empty where nothing can be kept: the footage cannot be read, or nothing tells the net from others.
std::string SamplesKey(const CachePlace& cache, const dataset::CameraFootage& footage, const dataset::MaskOptions& options,
                       bool keep_undamaged);
std::string ModelKey(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend);
/// BlockKey completes it. `room`: of RoomKey, or empty.
std::string MasksKey(const MaskJob& job, const MaskCamera& camera, const MaskBackend& backend, const std::string& room);
/// Of where the other cameras allow people.
std::string RoomKey(const MaskJob& job, const MaskBackend& backend);

/// Footage, plates, calibration and joints are told by their files. Empty also where 2D joints guide the masks.
std::string MaskChoiceKey(const MaskStageOptions& options, const TakeInput& take, const std::vector<MaskBackend>& backends);

std::string EncodeSamples(const dataset::FootageSamples& samples);
std::string EncodeLearned(const dataset::LearnedCamera& learned);
std::string EncodeMaskBlock(const MaskBlock& block);
std::string EncodeMaskTrials(const std::vector<MaskTrial>& trials);
/// Throw DamagedBytes.
dataset::FootageSamples DecodeSamples(const std::string& bytes);
dataset::LearnedCamera DecodeLearned(const std::string& bytes);
MaskBlock DecodeMaskBlock(const std::string& bytes);
std::vector<MaskTrial> DecodeMaskTrials(const std::string& bytes);

/// What `decode` makes of a kept result; nothing where it is missing or damaged.
template <class Decode>
auto LoadKept(const KeptResults& kept, const std::string& key, const Decode& decode)
    -> std::optional<decltype(decode(std::string()))> {
  const std::optional<std::string> bytes = key.empty() ? std::nullopt : kept.Load(key);
  if (!bytes) return std::nullopt;
  try {
    return decode(*bytes);
  } catch (const DamagedBytes&) {
    kept.Damaged(key);
  }
  return std::nullopt;
}

/// Removes what was kept for these masks.
void ForgetMasks(const MaskJob& job, const std::vector<MaskBackend>& backends, const std::string& choice);

}  // namespace mvstudio::stages
