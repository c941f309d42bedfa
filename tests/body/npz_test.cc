#include "dataset/arrays/npz.h"

#include <archive.h>
#include <archive_entry.h>

#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

struct Member {
  std::string name, content;
  unsigned type = AE_IFREG;
};

/// A ZIP archive of deflated members, as numpy.savez_compressed writes it.
std::string Deflated(const std::vector<Member>& members) {
  std::string bytes(1 << 20, '\0');
  size_t used = 0;
  archive* zip = archive_write_new();
  archive_write_set_format_zip(zip);
  archive_write_zip_set_compression_deflate(zip);
  EXPECT_EQ(archive_write_open_memory(zip, bytes.data(), bytes.size(), &used), ARCHIVE_OK);
  for (const Member& member : members) {
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, member.name.c_str());
    archive_entry_set_filetype(entry, member.type);
    archive_entry_set_perm(entry, 0644);
    if (member.type == AE_IFLNK) archive_entry_set_symlink(entry, "/etc/passwd");
    archive_entry_set_size(entry, static_cast<la_int64_t>(member.content.size()));
    EXPECT_EQ(archive_write_header(zip, entry), ARCHIVE_OK);
    archive_write_data(zip, member.content.data(), member.content.size());
    archive_entry_free(entry);
  }
  EXPECT_EQ(archive_write_close(zip), ARCHIVE_OK);
  archive_write_free(zip);
  bytes.resize(used);
  return bytes;
}

std::vector<double> Ramp(size_t count) {
  std::vector<double> values;
  for (size_t i = 0; i < count; ++i) values.push_back(0.5 * static_cast<double>(i));
  return values;
}

TEST(Npz, StoredMembersComeBack) {
  const TempDir folder;
  WriteFileAtomic(folder / "a.npz", NpzOf({{"x", NpyOfDoubles({2, 3}, Ramp(6))}, {"y", NpyOfInts({1}, {-7})}}));
  const auto arrays = dataset::ReadNpz(folder / "a.npz");
  ASSERT_EQ(arrays.size(), 2u);
  EXPECT_EQ(arrays.at("x").shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(arrays.at("x").values, Ramp(6));
  EXPECT_EQ(arrays.at("y").values, (std::vector<double>{-7}));
}

TEST(Npz, DeflatedMembersComeBack) {
  const std::string zip = Deflated({{"x.npy", NpyOfDoubles({5000}, Ramp(5000))}, {"y.npy", NpyOfInts({1}, {-7})}});
  EXPECT_LT(zip.size(), 30000u);
  const auto arrays = dataset::ParseNpz(zip, "a.npz");
  EXPECT_EQ(arrays.at("x").values, Ramp(5000));
  EXPECT_EQ(arrays.at("y").values, (std::vector<double>{-7}));
}

TEST(Npz, RefusesAnArchiveOfNothing) { EXPECT_THROW(dataset::ParseNpz(NpzOf({}), "a.npz"), FormatError); }

TEST(Npz, ErrorsNameFileAndMember) {
  const std::string zip = NpzOf({{"x", NpyOfDoubles({1}, {1})}, {"names", NpyOfTexts({"a"})}});
  EXPECT_THAT(MessageOf<FormatError>([&] { dataset::ParseNpz(zip, "a.npz"); }), HasSubstr("a.npz: names: descr"));
  EXPECT_EQ(ParseNpyTexts(dataset::ParseNpzMembers(zip, "a.npz").at("names"), "a.npz"), (std::vector<std::string>{"a"}));
}

TEST(Npz, RefusesWhatIsCutShort) {
  for (const std::string& zip : {NpzOf({{"x", NpyOfDoubles({2, 3}, Ramp(6))}}), Deflated({{"x.npy", NpyOfInts({1}, {1})}})}) {
    for (size_t size = 0; size < zip.size(); ++size) {
      EXPECT_THROW(dataset::ParseNpzMembers(zip.substr(0, size), "a.npz"), FormatError) << size << " of " << zip.size();
    }
  }
}

TEST(Npz, RefusesChangedBytesOfAMember) {
  std::string zip = NpzOf({{"x", NpyOfDoubles({2, 3}, Ramp(6))}});
  zip[30 + 5 + 128 + 3] ^= 1;  // in the doubles: only the checksum tells
  EXPECT_THAT(MessageOf<FormatError>([&] { dataset::ParseNpz(zip, "a.npz"); }), HasSubstr("a.npz: x"));
}

TEST(Npz, RefusesMembersThatAreNoArrays) {
  const std::string array = NpyOfInts({1}, {1});
  const auto message = [](const std::vector<Member>& members) {
    return MessageOf<FormatError>([&] { dataset::ParseNpzMembers(Deflated(members), "a.npz"); });
  };
  EXPECT_THAT(message({{"x.txt", "hello"}}), HasSubstr("x.txt: is no .npy file"));
  EXPECT_THAT(message({{".npy", array}}), HasSubstr("is no .npy file"));
  EXPECT_THAT(message({{"x.npy", "", AE_IFLNK}}), HasSubstr("is no plain file"));
  EXPECT_THAT(message({{"x.npy", "", AE_IFDIR}}), HasSubstr("is no plain file"));
  EXPECT_THAT(message({{"x.npy", array}, {"x.npy", array}}), HasSubstr("is there twice"));
  EXPECT_THROW(dataset::ParseNpz(Deflated({{"x.npy", "hello"}}), "a.npz"), FormatError);
}

TEST(Npz, HeadersAreLookedAtBeforeTheRestIsUnpacked) {
  std::string large = NpyOfDoubles({1, 4}, Ramp(4));
  const size_t at = large.find("(1, 4)");
  ASSERT_NE(at, std::string::npos) << large.substr(0, 80);
  large.replace(at, 6, "(9, 4)");
  EXPECT_THAT(MessageOf<FormatError>([&] {
                dataset::ParseNpzMembers(Deflated({{"x.npy", large}}), "a.npz");
              }),
              HasSubstr("x: shape: promises more than the "));
  const std::string zeros = Deflated({{"x.npy", std::string(300 << 20, '\0')}});
  EXPECT_THAT(MessageOf<FormatError>([&] { dataset::ParseNpzMembers(zeros, "a.npz"); }), HasSubstr("out of all proportion"));
}

TEST(Npz, RefusesWhatGrowsTooLarge) {
  const std::string zip = Deflated({{"x.npy", std::string(1 << 24, '\0')}});
  EXPECT_LT(zip.size(), 100000u);
  EXPECT_THAT(MessageOf<FormatError>([&] { dataset::ParseNpzMembers(zip, "a.npz", 1 << 20); }), HasSubstr("x: is too large"));
  const std::string two = NpzOf({{"x", std::string(600, 'x')}, {"y", std::string(600, 'y')}});
  EXPECT_THAT(MessageOf<FormatError>([&] { dataset::ParseNpzMembers(two, "a.npz", 1000); }), HasSubstr("y: is too large"));
  EXPECT_THAT(dataset::ParseNpzMembers(two, "a.npz", 1200), Not(IsEmpty()));
}

}  // namespace
}  // namespace mvstudio::body
