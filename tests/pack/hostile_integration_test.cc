#include <gmock/gmock.h>
#include <hdf5.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>

#include "dataset/arrays/child_process.h"
#include "dataset/arrays/hdf5_handle.h"
#include "dataset/arrays/hdf5_reader.h"
#include "dataset/pack/pack.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/sanitized.h"

/// Files made to harm are refused with a reason, in little time and memory.
namespace mvstudio::dataset {
namespace {

using internal::ChildLimits;
using internal::Hid;
using internal::RunInChild;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

constexpr uint64_t kMiB = 1 << 20;

std::string MakeFile(const std::string& path, const std::function<void(hid_t)>& fill) {
  const auto lock = internal::LockHdf5();
  const Hid access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  const Hid file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access), H5Fclose);
  EXPECT_TRUE(file.ok());
  fill(file);
  return path;
}

Hid Space(std::vector<hsize_t> dims) {
  return Hid(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose);
}

Hid Chunked(std::vector<hsize_t> chunk) {
  Hid properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(properties, static_cast<int>(chunk.size()), chunk.data());
  return properties;
}

Hid Create(hid_t file, const char* name, hid_t type, const Hid& space, hid_t properties = H5P_DEFAULT) {
  Hid dataset(H5Dcreate2(file, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
  EXPECT_TRUE(dataset.ok()) << name << ": " << internal::LastHdf5Error();
  return dataset;
}

Hid Group(hid_t parent, const std::string& name) {
  return Hid(H5Gcreate2(parent, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
}

struct Trap {
  const char* name;
  const char* message;
  std::function<void(hid_t)> fill;
};

void FillVirtual(hid_t file) {
  const Hid properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const Hid space = Space({16});
  H5Pset_virtual(properties, space, "/etc/passwd", "data", space);
  Create(file, "plan", H5T_STD_U8LE, space, properties);
}

void FillExternalStorage(hid_t file) {
  const Hid properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_external(properties, "/etc/passwd", 0, 16);
  Create(file, "plan", H5T_STD_U8LE, Space({16}), properties);
}

void FillUnknownFilter(hid_t file) {
  const Hid properties = Chunked({16});
  H5Pset_filter(properties, 32004, H5Z_FLAG_OPTIONAL, 0, nullptr);
  Create(file, "plan", H5T_STD_U8LE, Space({16}), properties);
}

void FillBomb(hid_t file) {
  const Hid properties = Chunked({64 * kMiB});
  H5Pset_deflate(properties, 9);
  const Hid dataset = Create(file, "blob", H5T_STD_U8LE, Space({128 * kMiB}), properties);
  const std::vector<uint8_t> zeros(128 * kMiB);
  EXPECT_GE(H5Dwrite(dataset, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros.data()), 0);
}

void FillDeep(hid_t file) {
  std::vector<Hid> groups;
  groups.push_back(Group(file, "g"));
  for (int i = 0; i < 100; ++i) groups.push_back(Group(groups.back(), "g"));
}

void FillAttributes(hid_t file) {
  const Hid space(H5Screate(H5S_SCALAR), H5Sclose);
  for (int i = 0; i < 2000; ++i) {
    const Hid attribute(H5Acreate2(file, ("a" + std::to_string(i)).c_str(), H5T_STD_I32LE, space, H5P_DEFAULT, H5P_DEFAULT),
                        H5Aclose);
  }
}

void FillVariableText(hid_t file) {
  const Hid type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, H5T_VARIABLE);
  Create(file, "plan", type, Space({4}));
}

void FillCompound(hid_t file) {
  const Hid type(H5Tcreate(H5T_COMPOUND, 8), H5Tclose);
  H5Tinsert(type, "a", 0, H5T_STD_I32LE);
  Create(file, "plan", type, Space({4}));
}

std::vector<Trap> Traps() {
  return {
      {"external link", "link to another file",
       [](hid_t f) { H5Lcreate_external("/etc/passwd", "/", f, "samples", H5P_DEFAULT, H5P_DEFAULT); }},
      {"soft link loop", "soft link",
       [](hid_t f) {
         H5Lcreate_soft("/b", f, "a", H5P_DEFAULT, H5P_DEFAULT);
         H5Lcreate_soft("/a", f, "b", H5P_DEFAULT, H5P_DEFAULT);
       }},
      {"hard link loop", "by two names",
       [](hid_t f) {
         const Hid group = Group(f, "samples");
         H5Lcreate_hard(f, "samples", group, "again", H5P_DEFAULT, H5P_DEFAULT);
       }},
      {"virtual dataset", "virtual dataset", FillVirtual},
      {"data in another file", "in another file", FillExternalStorage},
      {"unknown filter", "filter 32004", FillUnknownFilter},
      {"2^62 elements", "claims 4611686018427387904 bytes",
       [](hid_t f) { Create(f, "blob", H5T_STD_U8LE, Space({hsize_t{1} << 62}), Chunked({1024})); }},
      {"sizes that overflow", "claims 18446744073709551615 bytes",
       [](hid_t f) {
         Create(f, "blob", H5T_IEEE_F64LE, Space({hsize_t{1} << 30, hsize_t{1} << 32}), Chunked({8, 8}));
       }},
      {"chunks of 4 GB", "chunks of 4294967295 bytes",
       [](hid_t f) { Create(f, "blob", H5T_STD_U8LE, Space({hsize_t{1} << 33}), Chunked({0xffffffff})); }},
      {"variable length", "variable length", FillVariableText},
      {"compound type", "plain numbers", FillCompound},
      {"big-endian numbers", "not little-endian", [](hid_t f) { Create(f, "plan", H5T_STD_I32BE, Space({4})); }},
      {"references", "plain numbers", [](hid_t f) { Create(f, "plan", H5T_STD_REF_OBJ, Space({4})); }},
      {"named type", "neither group nor dataset",
       [](hid_t f) {
         const Hid type(H5Tcopy(H5T_STD_I32LE), H5Tclose);
         H5Tcommit2(f, "t", type, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
       }},
      {"100 000 groups", "holds 100000 members",
       [](hid_t f) {
         for (int i = 0; i < 100000; ++i) Group(f, std::to_string(i));
       }},
      {"deep groups", "nested deeper", FillDeep},
      {"2000 attributes", "2000 attributes", FillAttributes},
      {"deflate bomb", "claims 134217728 bytes", FillBomb},
      {"no pack at all", "no pack of mvstudio", [](hid_t f) { Create(f, "plan", H5T_STD_U8LE, Space({4})); }},
  };
}

TEST(HostileHdf5, IsRefusedWithItsReason) {
  const TempDir folder;
  for (const Trap& trap : Traps()) {
    const std::string path = MakeFile(folder / "trap.h5", trap.fill);
    EXPECT_THAT(MessageOf<FormatError>([&] { OpenPack(path); }), HasSubstr(trap.message)) << trap.name;
    const PackReport report = VerifyPack(path);
    EXPECT_EQ(report.num_errors(), 1) << trap.name;
  }
  rusage children{};
  getrusage(RUSAGE_CHILDREN, &children);
  EXPECT_LT(children.ru_maxrss, 1500 * 1024) << "kB";
}

TEST(HostileHdf5, AChunkThatUnpacksToMoreThanItIsMeetsTheMemoryLimit) {
  if (mvstudio::testing::kSanitized) GTEST_SKIP() << "the sanitizer ends a program that runs out of memory";
  const TempDir folder;
  MakeFile(folder / "bomb.h5", FillBomb);
  const std::string path = MakeFile(folder / "trap.h5", [&](hid_t f) {
    const Hid bomb(H5Fopen((folder / "bomb.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    const Hid source(H5Dopen2(bomb, "blob", H5P_DEFAULT), H5Dclose);
    hsize_t bytes = 0;
    const hsize_t start = 0;
    ASSERT_GE(H5Dget_chunk_storage_size(source, &start, &bytes), 0);
    std::vector<char> packed(bytes);
    uint32_t mask = 0;
    ASSERT_GE(H5Dread_chunk(source, H5P_DEFAULT, &start, &mask, packed.data()), 0);
    const Hid properties = Chunked({4096});
    H5Pset_deflate(properties, 9);
    const Hid plan = Create(f, "plan", H5T_STD_U8LE, Space({4096}), properties);
    ASSERT_GE(H5Dwrite_chunk(plan, H5P_DEFAULT, 0, &start, packed.size(), packed.data()), 0);
  });
  ChildLimits limits;
  limits.max_memory_bytes = 48 * kMiB;
  const auto read = [&] {
    return RunInChild(path, limits, [&] { return std::to_string(internal::Hdf5Reader(path).Array<uint8_t>("/plan").size()); });
  };
  EXPECT_THAT(MessageOf<FormatError>(read), HasSubstr("/plan: is damaged"));
}

TEST(HostileHdf5, OtherThingsThatAreNoPack) {
  const TempDir folder;
  std::ofstream(folder / "empty.h5");
  std::ofstream(folder / "text.h5") << std::string(5000, 'x');
  std::ofstream(folder / "head.h5") << "\x89HDF\r\n\x1a\n" << std::string(5000, '\xff');
  for (const char* name : {"empty.h5", "text.h5", "head.h5"}) EXPECT_THROW(OpenPack(folder / name), FormatError) << name;
  ASSERT_EQ(mkfifo((folder / "pipe.h5").c_str(), 0600), 0);
  EXPECT_THROW(OpenPack(folder / "pipe.h5"), IoError) << "and does not wait for a writer";
  EXPECT_FALSE(IsPack(folder / "pipe.h5"));
  EXPECT_THROW(OpenPack(folder / "none.h5"), IoError);
  EXPECT_THROW(OpenPack(folder.path()), FormatError);
}

TEST(HostileHdf5, AnIndexCannotNameFilesElsewhere) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  const std::string index = ReadFile(folder / "pack/INDEX.json");
  for (const char* name : {"../pack/shard-00000.h5", "/etc/passwd", "shard-00001.h5", "shard-00000.h5\\n", ""}) {
    std::string changed = index;
    changed.replace(changed.find("shard-00000.h5"), 14, name);
    WriteFileAtomic(folder / "pack/INDEX.json", changed);
    EXPECT_THAT(MessageOf<FormatError>([&] { OpenPack(folder / "pack"); }), HasSubstr("shards[0].file")) << name;
  }
  for (size_t length = 0; length < index.size(); length += 7) {
    WriteFileAtomic(folder / "pack/INDEX.json", index.substr(0, length));
    EXPECT_THROW(OpenPack(folder / "pack"), FormatError) << length;
  }
}

// A file with right checksums that says wrong things: as one made by hand.
TEST(HostileHdf5, TablesThatContradictThemselvesAreRefused) {
  const TempDir folder;
  WriteStudio(folder / "data", 2, 2);
  BuildPack(folder / "data", folder / "pack", SmallPack());
  const std::string shard = folder / "pack/shard-00000.h5";
  const auto with = [&](const char* table, auto value, size_t at) {
    std::filesystem::copy_file(shard, folder / "trap.h5", std::filesystem::copy_options::overwrite_existing);
    const auto lock = internal::LockHdf5();
    const Hid file(H5Fopen((folder / "trap.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    const Hid dataset(H5Dopen2(file, table, H5P_DEFAULT), H5Dclose);
    using T = decltype(value);
    const Hid space(H5Dget_space(dataset), H5Sclose);
    std::vector<T> all(static_cast<size_t>(H5Sget_simple_extent_npoints(space)));
    H5Dread(dataset, internal::MemoryType<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data());
    all[at] = value;
    EXPECT_GE(H5Dwrite(dataset, internal::MemoryType<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, all.data()), 0);
  };
  const auto refusal = [&] { return MessageOf<FormatError>([&] { OpenPack(folder / "trap.h5"); }); };
  with("/samples/image_offset", uint64_t{0xffffffffffffff00}, 1);
  EXPECT_THAT(refusal(), HasSubstr("image outside the blob"));
  with("/samples/image_bytes", uint64_t{0}, 2);
  EXPECT_THAT(refusal(), HasSubstr("image outside the blob"));
  with("/samples/size_px", int32_t{0x7fffffff}, 0);
  EXPECT_THAT(refusal(), HasSubstr("no size of an image"));
  with("/samples/K", std::nan(""), 0);
  EXPECT_THAT(refusal(), HasSubstr("no camera matrix"));
  with("/samples/cam_from_world", 2.0, 0);
  EXPECT_THAT(refusal(), HasSubstr("holds no rotation"));
  with("/samples/pose", int32_t{99}, 3);
  EXPECT_THAT(refusal(), HasSubstr("no row of the poses"));
  with("/samples/part", uint8_t{7}, 3);
  EXPECT_THAT(refusal(), HasSubstr("must be 0, 1, 2 or 3"));
  with("/poses/joints_in_world", std::numeric_limits<double>::infinity(), 4);
  EXPECT_THAT(refusal(), HasSubstr("not finite"));
  with("/samples/joints_px", 3.0, 4);
  EXPECT_THAT(refusal(), HasSubstr("content_sha256"));
}

TEST(RunInChild, ReturnsTextAndThrowsWhatWasThrown) {
  EXPECT_EQ(RunInChild("p", {}, [] { return std::string(1 << 20, 'x'); }), std::string(1 << 20, 'x'));
  EXPECT_EQ(RunInChild("p", {}, [] { return std::string(); }), "");
  const auto message = [](const std::function<std::string()>& work) {
    return MessageOf<Error>([&] { RunInChild("p", {}, work); });
  };
  EXPECT_EQ(message([]() -> std::string { throw FormatError("file", "place", "what"); }), "file: place: what");
  EXPECT_EQ(message([]() -> std::string { throw FormatError("file", "", "what"); }), "file: what");
  EXPECT_EQ(message([]() -> std::string { throw IoError("file", "what"); }), "file: what");
  EXPECT_THROW(RunInChild("p", {}, []() -> std::string { throw IoError("file", "what"); }), IoError);
  EXPECT_THROW(RunInChild("p", {}, []() -> std::string { throw ResourceError("full"); }), ResourceError);
}

TEST(RunInChild, SurvivesCrashesLoopsAndGreed) {
  const auto refusal = [](const ChildLimits& limits, const std::function<std::string()>& work) {
    return MessageOf<FormatError>([&] { RunInChild("file.h5", limits, work); });
  };
  EXPECT_THAT(refusal({},
                      []() -> std::string {
                        raise(SIGSEGV);
                        return "";
                      }),
              HasSubstr("file.h5: reading it brings the HDF5 library down"));
  EXPECT_THAT(refusal({}, []() -> std::string { _exit(0); }), HasSubstr("brings the HDF5 library down"));
  ChildLimits brief;
  brief.deadline_s = 0.2;
  EXPECT_THAT(refusal(brief,
                      []() -> std::string {
                        for (volatile int i = 0;; i = i + 1) {
                        }
                      }),
              HasSubstr("did not end in time"));
  ChildLimits small;
  small.max_memory_bytes = 32 * kMiB;
  if (mvstudio::testing::kSanitized) return;  // the sanitizer ends a program that runs out of memory
  EXPECT_THAT(refusal(small, [] { return std::string(256 * kMiB, 'x'); }), HasSubstr("more memory"));
}

/// The child says that it runs and sleeps; its end of the pipe closes when it is gone.
TEST(RunInChild, EndsWithTheProcessThatAskedForIt) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t asking = fork();
  if (asking == 0) {
    RunInChild("p", {}, [&]() -> std::string {
      if (write(ends[1], "x", 1) != 1) _exit(1);
      for (;;) pause();
    });
    _exit(0);
  }
  close(ends[1]);
  char byte = 0;
  ASSERT_EQ(read(ends[0], &byte, 1), 1);
  kill(asking, SIGKILL);
  ASSERT_EQ(waitpid(asking, nullptr, 0), asking);
  constexpr int kPatienceMs = 10000;  // the child would sleep for ever
  pollfd closing = {ends[0], POLLIN, 0};
  EXPECT_EQ(poll(&closing, 1, kPatienceMs), 1);
  EXPECT_EQ(read(ends[0], &byte, 1), 0);
  close(ends[0]);
}

}  // namespace
}  // namespace mvstudio::dataset
