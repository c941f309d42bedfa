#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "dataset/arrays/hdf5_handle.h"
#include "dataset/arrays/hdf5_writer.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr uint64_t kAutoChunkBytes = 1 << 20;
constexpr size_t kEofOffset = 28;  // of the end-of-file address in a superblock of version 2 and 3 with 8-byte addresses

// The memory driver frees its buffer when the file is closed; these callbacks keep it instead (H5Pset_file_image_callbacks).
void* Allocate(size_t size, H5FD_file_image_op_t, void*) { return std::malloc(size); }
void* Copy(void* to, const void* from, size_t size, H5FD_file_image_op_t, void*) { return std::memcpy(to, from, size); }
void* Reallocate(void* data, size_t size, H5FD_file_image_op_t, void*) { return std::realloc(data, size); }
herr_t Release(void* data, H5FD_file_image_op_t operation, void* user) {
  if (operation == H5FD_FILE_IMAGE_OP_FILE_CLOSE) {
    static_cast<FileImage*>(user)->data.reset(data);
  } else {
    std::free(data);
  }
  return 0;
}
void* CopyUser(void* user) { return user; }
herr_t ReleaseUser(void*) { return 0; }

Hid UntimedProperties(hid_t property_class) {
  Hid properties(H5Pcreate(property_class), H5Pclose);
  H5Pset_obj_track_times(properties, false);
  return properties;
}

// Links and attributes stay in the object's header, which has a checksum.
Hid GroupProperties(hid_t property_class) {
  Hid properties = UntimedProperties(property_class);
  H5Pset_link_phase_change(properties, 1024, 512);
  H5Pset_attr_phase_change(properties, 64, 32);
  return properties;
}

std::vector<hsize_t> ChunkOf(const std::vector<uint64_t>& dims, size_t item_bytes, const ArrayLayout& layout) {
  if (!layout.chunk.empty()) return {layout.chunk.begin(), layout.chunk.end()};
  std::vector<hsize_t> chunk(dims.begin(), dims.end());
  uint64_t row_bytes = item_bytes;
  for (size_t k = 1; k < dims.size(); ++k) row_bytes *= dims[k];
  chunk[0] = std::clamp<uint64_t>(kAutoChunkBytes / std::max<uint64_t>(row_bytes, 1), 1, dims[0]);
  return chunk;
}

Hid DatasetProperties(const std::vector<uint64_t>& dims, size_t item_bytes, const ArrayLayout& layout) {
  Hid properties = UntimedProperties(H5P_DATASET_CREATE);
  H5Pset_attr_phase_change(properties, 64, 32);
  // HDF5 has no chunks for datasets without an element; there is nothing to protect in them.
  if (std::find(dims.begin(), dims.end(), 0u) != dims.end()) return properties;
  const std::vector<hsize_t> chunk = ChunkOf(dims, item_bytes, layout);
  H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data());
  if (layout.deflate > 0) {
    if (item_bytes > 1) H5Pset_shuffle(properties);
    H5Pset_deflate(properties, static_cast<unsigned>(layout.deflate));
  }
  H5Pset_fletcher32(properties);
  return properties;
}

}  // namespace

Hdf5Writer::Hdf5Writer(std::string label) : lock_(LockHdf5()), label_(std::move(label)) {
  const Hid access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  H5Pset_fapl_core(access, 1 << 20, false);
  H5FD_file_image_callbacks_t callbacks = {Allocate, Copy, Reallocate, Release, CopyUser, ReleaseUser, &image_};
  H5Pset_file_image_callbacks(access, &callbacks);
  const Hid creation = GroupProperties(H5P_FILE_CREATE);
  file_ = Hid(H5Fcreate("in memory", H5F_ACC_TRUNC, creation, access), H5Fclose);
  if (!file_.ok()) Fail("", "create a file in memory");
}

Hdf5Writer::~Hdf5Writer() = default;

void Hdf5Writer::Fail(const std::string& path, const std::string& action) const {
  throw IoError(label_, "cannot " + action + " " + path + ": " + LastHdf5Error());
}

void Hdf5Writer::Group(const std::string& path) {
  for (size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    const std::string part = path.substr(0, end);
    if (part.size() > 1 && H5Lexists(file_, part.c_str(), H5P_DEFAULT) <= 0) {
      const Hid properties = GroupProperties(H5P_GROUP_CREATE);
      const Hid group(H5Gcreate2(file_, part.c_str(), H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose);
      if (!group.ok()) Fail(part, "make the group");
    }
    if (end == std::string::npos) return;
  }
}

void Hdf5Writer::Array(const std::string& path, const std::vector<uint64_t>& dims, const void* data, hid_t file_type,
                       hid_t memory_type, size_t item_bytes, const ArrayLayout& layout) {
  const size_t slash = path.rfind('/');
  if (slash != std::string::npos && slash > 0) Group(path.substr(0, slash));
  const std::vector<hsize_t> sizes(dims.begin(), dims.end());
  const Hid space(H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr), H5Sclose);
  const Hid properties = DatasetProperties(dims, item_bytes, layout);
  Hid dataset(H5Dcreate2(file_, path.c_str(), file_type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) Fail(path, "make the dataset");
  const bool empty = std::find(dims.begin(), dims.end(), 0u) != dims.end();
  if (!empty && H5Dwrite(dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) Fail(path, "fill");
  if (dataset.Close() < 0) Fail(path, "close");
}

void Hdf5Writer::Attribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type,
                           const void* value) {
  const Hid target(H5Oopen(file_, object.c_str(), H5P_DEFAULT), H5Oclose);
  const Hid space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hid attribute(H5Acreate2(target, name.c_str(), file_type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok() || H5Awrite(attribute, memory_type, value) < 0) Fail(object + "@" + name, "write");
}

void Hdf5Writer::Attribute(const std::string& object, const std::string& name, const std::string& text) {
  const Hid type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, std::max<size_t>(text.size(), 1));
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  Attribute(object, name, type, type, text.c_str());
}

FileImage Hdf5Writer::Finish() {
  if (file_.Close() < 0 || !image_.data) Fail("", "close the file in memory");
  std::memcpy(&image_.size, static_cast<const char*>(image_.data.get()) + kEofOffset, sizeof(uint64_t));
  return std::move(image_);
}

}  // namespace mvstudio::dataset::internal
