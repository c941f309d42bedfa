// Private: HDF5's types, for the .cc files of this folder and of exports/.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "dataset/arrays/hdf5_handle.h"

namespace mvstudio::dataset::internal {

/// Limits on a file, checked before its data are read.
struct Hdf5Limits {
  uint64_t max_objects = 1000;  ///< groups and datasets
  int max_depth = 8;
  int max_attributes = 64;          ///< of one object
  uint64_t max_bytes = 1ull << 36;  ///< of all datasets together, unpacked
  uint64_t max_chunk_bytes = 1 << 28;
  double max_ratio = 200;  ///< unpacked bytes to bytes of the file; deflate cannot do better than about 1000
};

/// Reads a file after checking its whole structure. Allowed are hard links only (no soft, external or user-defined links),
/// and no virtual or external datasets. No named types; only numbers or fixed text of standard size. The only filters are
/// shuffle, deflate and fletcher32. Dimensions must multiply without overflow and fit the file. Throws IoError, or
/// FormatError with the object.
///
/// The library itself can crash or loop on a damaged file: for files from others use RunInChild (child_process.h)
/// first.
class Hdf5Reader {
 public:
  explicit Hdf5Reader(const std::string& path, const Hdf5Limits& limits = {});

  bool Has(const std::string& object) const;
  bool HasAttribute(const std::string& object, const std::string& name) const;
  std::vector<uint64_t> Dims(const std::string& dataset) const;
  /// Whole dataset of exactly this type and, when `dims` is not empty, exactly these dimensions.
  template <class T>
  std::vector<T> Array(const std::string& dataset, const std::vector<uint64_t>& dims = {}) const {
    std::vector<T> data(CheckArray(dataset, FileType<T>(), dims));
    ReadAll(dataset, MemoryType<T>(), data.data());
    return data;
  }
  std::string TextAttribute(const std::string& object, const std::string& name) const;
  template <class T>
  T Attribute(const std::string& object, const std::string& name) const {
    T value{};
    ReadAttribute(object, name, FileType<T>(), MemoryType<T>(), &value);
    return value;
  }

  /// Where the pieces of a one-dimensional, uncompressed byte dataset lie in the file.
  struct Chunk {
    uint64_t file_offset = 0;
    uint64_t stored_bytes = 0;
  };
  struct Chunks {
    uint64_t chunk_bytes = 0;
    std::vector<Chunk> chunks;  // in order
  };
  Chunks ByteChunks(const std::string& dataset) const;

  const std::string& path() const { return path_; }
  uint64_t file_bytes() const { return file_bytes_; }

 private:
  size_t CheckArray(const std::string& dataset, hid_t type, const std::vector<uint64_t>& dims) const;
  void ReadAll(const std::string& dataset, hid_t memory_type, void* data) const;
  void ReadAttribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type, void* value) const;
  Hid OpenDataset(const std::string& dataset) const;
  [[noreturn]] void Fail(const std::string& object, const std::string& what) const;

  std::string path_;
  uint64_t file_bytes_ = 0;
  std::unique_lock<std::recursive_mutex> lock_;
  Hid file_;
};

/// The structure rules above. Throws FormatError.
void CheckHdf5Structure(hid_t file, const std::string& path, uint64_t file_bytes, const Hdf5Limits& limits);

}  // namespace mvstudio::dataset::internal
