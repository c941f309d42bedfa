// Private: what a Pack keeps, for pack.cc and verify.cc.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/arrays/child_process.h"
#include "dataset/pack/codec.h"
#include "dataset/pack/pack.h"
#include "dataset/pack/pack_json.h"
#include "dataset/pack/shard.h"

namespace mvstudio::dataset {

/// A file that stays open for reading at any offset.
class PackFile {
 public:
  PackFile(std::string path, const internal::Hdf5Reader::Chunks& chunks);
  ~PackFile();
  PackFile(PackFile&& other) noexcept;
  PackFile(const PackFile&) = delete;
  PackFile& operator=(const PackFile&) = delete;

  /// `bytes` of the blob from `offset`, which lie in one chunk.
  std::string Read(uint64_t offset, uint64_t bytes) const;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  int fd_ = -1;
  internal::Hdf5Reader::Chunks chunks_;
};

struct Pack::Data {
  PackInfo info;
  PackCodec codec;
  geometry::Rig rig;
  std::vector<PackSample> samples;

  struct Piece {
    uint64_t offset = 0, bytes = 0;
    uint32_t crc32 = 0;
  };
  struct Place {
    int file = 0;
    size_t row = 0;  ///< in the file, for messages
    Piece image, mask;
  };
  std::vector<Place> places;
  std::vector<PackFile> files;
};

namespace internal {

ChildLimits LimitsOf(const PackOpenOptions& options, uint64_t file_bytes, bool whole_file);
/// ReadShard for files that may be hostile: tried in a child process first if the options say so.
ReadShardResult ReadShardCarefully(const std::string& path, const PackOpenOptions& options);
/// Adds a shard's samples. Throws FormatError when it is of another pack than those before.
void AddShard(const std::string& path, const ReadShardResult& read, Pack::Data* data);
/// Fills the counts of `info`.
void Summarise(Pack::Data* data);

}  // namespace internal
}  // namespace mvstudio::dataset
