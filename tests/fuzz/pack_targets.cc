#include "core/disk/files.h"
#include "dataset/pack/pack_json.h"
#include "tests/fuzz/fuzz.h"

/// The JSON files beside the shards of a pack. The shards themselves: docs/fuzzing.md.
namespace mvstudio::fuzz {

namespace pack = dataset::internal;

MVS_FUZZ_TARGET(pack_index, bytes) {
  const std::string path = InMemory("INDEX.json", bytes);
  pack::PackIndex index;
  if (!Accepts([&] { index = pack::ReadIndex(path); })) return;
  for (const pack::DoneMarker& marker : index.shards) {
    Require(marker.file.find('/') == std::string::npos && !marker.file.empty(), "a shard outside the folder");
  }
  const std::string text = pack::IndexToJsonText(index);
  std::string again;
  Require(Accepts([&] { again = pack::IndexToJsonText(pack::ReadIndex(InMemory("again.json", text))); }),
          "what was written cannot be read");
  Require(again == text, "the index changes when it is read and written again");
}

MVS_FUZZ_TARGET(pack_done, bytes) {
  const std::string path = Scratch("shard-00000.done.json", bytes);
  std::optional<pack::DoneMarker> marker;
  if (!Accepts([&] { marker = pack::ReadDone(path); })) return;
  Require(marker.has_value(), "a file that is there was not read");
  const std::string text = pack::DoneToJsonText(*marker);
  std::string again;
  Require(Accepts([&] { again = pack::DoneToJsonText(pack::ReadDone(Scratch("again.json", text)).value()); }),
          "what was written cannot be read");
  Require(again == text, "the marker changes when it is read and written again");
}

}  // namespace mvstudio::fuzz
