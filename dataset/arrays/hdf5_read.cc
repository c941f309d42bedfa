#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/join.h"
#include "dataset/arrays/hdf5_handle.h"
#include "dataset/arrays/hdf5_reader.h"

namespace mvstudio::dataset::internal {
namespace {

herr_t KeepFirst(unsigned, const H5E_error2_t* error, void* text) {
  auto& words = *static_cast<std::string*>(text);
  if (words.empty() && error->desc) words = error->desc;
  return 0;
}

bool in_child = false;

}  // namespace

void RenewHdf5LockInChild() { in_child = true; }

std::unique_lock<std::recursive_mutex> LockHdf5() {
  static std::recursive_mutex mutexes[2];  // of the process that began, of its child
  std::unique_lock<std::recursive_mutex> lock(mutexes[in_child ? 1 : 0]);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  return lock;
}

std::string LastHdf5Error() {
  std::string words;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, KeepFirst, &words);
  return words.empty() ? "no reason given" : words;
}

template <>
hid_t FileType<uint8_t>() {
  return H5T_STD_U8LE;
}
template <>
hid_t FileType<int32_t>() {
  return H5T_STD_I32LE;
}
template <>
hid_t FileType<uint32_t>() {
  return H5T_STD_U32LE;
}
template <>
hid_t FileType<int64_t>() {
  return H5T_STD_I64LE;
}
template <>
hid_t FileType<uint64_t>() {
  return H5T_STD_U64LE;
}
template <>
hid_t FileType<float>() {
  return H5T_IEEE_F32LE;
}
template <>
hid_t FileType<double>() {
  return H5T_IEEE_F64LE;
}
template <>
hid_t MemoryType<uint8_t>() {
  return H5T_NATIVE_UINT8;
}
template <>
hid_t MemoryType<int32_t>() {
  return H5T_NATIVE_INT32;
}
template <>
hid_t MemoryType<uint32_t>() {
  return H5T_NATIVE_UINT32;
}
template <>
hid_t MemoryType<int64_t>() {
  return H5T_NATIVE_INT64;
}
template <>
hid_t MemoryType<uint64_t>() {
  return H5T_NATIVE_UINT64;
}
template <>
hid_t MemoryType<float>() {
  return H5T_NATIVE_FLOAT;
}
template <>
hid_t MemoryType<double>() {
  return H5T_NATIVE_DOUBLE;
}

Hdf5Reader::Hdf5Reader(const std::string& path, const Hdf5Limits& limits) : path_(path), lock_(LockHdf5()) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) {
    throw IoError(path, code ? "cannot read: " + code.message() : "is no file");
  }
  file_bytes_ = std::filesystem::file_size(path, code);
  if (code) throw IoError(path, "cannot read: " + code.message());
  const Hid access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  file_ = Hid(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose);
  if (!file_.ok()) {
    throw FormatError(path, "",
                      "is no readable HDF5 file, or is cut off or damaged (" + LastHdf5Error() +
                          "); make it again, never repair it in place");
  }
  CheckHdf5Structure(file_, path_, file_bytes_, limits);
}

void Hdf5Reader::Fail(const std::string& object, const std::string& what) const { throw FormatError(path_, object, what); }

bool Hdf5Reader::Has(const std::string& object) const {
  for (size_t end = object.find('/', 1);; end = object.find('/', end + 1)) {
    if (H5Lexists(file_, object.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
    if (end == std::string::npos) return true;
  }
}

bool Hdf5Reader::HasAttribute(const std::string& object, const std::string& name) const {
  return (object == "/" || Has(object)) && H5Aexists_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

Hid Hdf5Reader::OpenDataset(const std::string& dataset) const {
  if (!Has(dataset)) Fail(dataset, "is missing");
  Hid id(H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!id.ok()) Fail(dataset, "cannot be opened as a dataset: " + LastHdf5Error());
  return id;
}

std::vector<uint64_t> Hdf5Reader::Dims(const std::string& dataset) const {
  const Hid id = OpenDataset(dataset);
  const Hid space(H5Dget_space(id), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0) Fail(dataset, "has no dimensions");
  std::vector<hsize_t> dims(static_cast<size_t>(rank));
  H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  return {dims.begin(), dims.end()};
}

size_t Hdf5Reader::CheckArray(const std::string& dataset, hid_t type, const std::vector<uint64_t>& dims) const {
  const std::vector<uint64_t> found = Dims(dataset);
  const Hid id = OpenDataset(dataset);
  const Hid found_type(H5Dget_type(id), H5Tclose);
  if (H5Tequal(found_type, type) <= 0) Fail(dataset, "holds numbers of another type or byte order than the format says");
  if (!dims.empty() && found != dims) {
    const std::string text = Join(found, " x ", [](uint64_t d) { return std::to_string(d); });
    Fail(dataset, "has the wrong size, " + (text.empty() ? "a single value" : text));
  }
  size_t count = 1;
  for (const uint64_t d : found) count *= d;  // checked against overflow with the file's structure
  return count;
}

void Hdf5Reader::ReadAll(const std::string& dataset, hid_t memory_type, void* data) const {
  const Hid id = OpenDataset(dataset);
  if (!data) return;
  if (H5Dread(id, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) {
    Fail(dataset, "is damaged: " + LastHdf5Error() + "; make the file again");
  }
}

void Hdf5Reader::ReadAttribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type,
                               void* value) const {
  const std::string place = object + "@" + name;
  if (!HasAttribute(object, name)) Fail(place, "is missing");
  const Hid attribute(H5Aopen_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const Hid type(H5Aget_type(attribute), H5Tclose);
  const Hid space(H5Aget_space(attribute), H5Sclose);
  if (H5Tequal(type, file_type) <= 0 || H5Sget_simple_extent_npoints(space) != 1) Fail(place, "has the wrong type or size");
  if (H5Aread(attribute, memory_type, value) < 0) Fail(place, "is damaged: " + LastHdf5Error());
}

std::string Hdf5Reader::TextAttribute(const std::string& object, const std::string& name) const {
  const std::string place = object + "@" + name;
  if (!HasAttribute(object, name)) Fail(place, "is missing");
  const Hid attribute(H5Aopen_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const Hid type(H5Aget_type(attribute), H5Tclose);
  const Hid space(H5Aget_space(attribute), H5Sclose);
  const bool text = H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) <= 0;
  if (!text || H5Sget_simple_extent_npoints(space) != 1) Fail(place, "must be one text of fixed length");
  std::string value(H5Tget_size(type), '\0');
  if (H5Aread(attribute, type, value.data()) < 0) Fail(place, "is damaged: " + LastHdf5Error());
  value.resize(std::min(value.size(), value.find('\0')));
  return value;
}

Hdf5Reader::Chunks Hdf5Reader::ByteChunks(const std::string& dataset) const {
  Chunks result;
  const uint64_t total = CheckArray(dataset, FileType<uint8_t>(), {});
  if (Dims(dataset).size() != 1) Fail(dataset, "must have one dimension");
  if (total == 0) return result;
  const Hid id = OpenDataset(dataset);
  const Hid properties(H5Dget_create_plist(id), H5Pclose);
  hsize_t chunk = 0;
  if (H5Pget_layout(properties) != H5D_CHUNKED || H5Pget_chunk(properties, 1, &chunk) != 1) Fail(dataset, "must be chunked");
  if (H5Pget_nfilters(properties) != 1) Fail(dataset, "must have fletcher32 and no other filter");
  const Hid space(H5Dget_space(id), H5Sclose);
  hsize_t count = 0;
  if (H5Dget_num_chunks(id, space, &count) < 0 || count != (total + chunk - 1) / chunk) Fail(dataset, "lacks chunks");
  result.chunk_bytes = chunk;
  result.chunks.resize(count);
  for (hsize_t i = 0; i < count; ++i) {
    hsize_t offset = 0, bytes = 0;
    haddr_t address = 0;
    unsigned skipped_filters = 0;
    if (H5Dget_chunk_info(id, space, i, &offset, &skipped_filters, &address, &bytes) < 0) {
      Fail(dataset, "is damaged: " + LastHdf5Error());
    }
    const bool inside = address <= file_bytes_ && bytes <= file_bytes_ - address;
    if (offset % chunk || offset / chunk >= count || skipped_filters || bytes < chunk || !inside) {
      Fail(dataset, "has an impossible chunk " + std::to_string(i));
    }
    result.chunks[offset / chunk] = {address, bytes};
  }
  return result;
}

}  // namespace mvstudio::dataset::internal
