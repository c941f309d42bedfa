// The functions of libc that the fault library stands in for.
#include <dirent.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include "tests/faults/shim.h"

namespace {

using namespace shim;

bool Creates(int flags) { return (flags & (O_CREAT | O_TRUNC)) || (flags & O_TMPFILE) == O_TMPFILE || (flags & O_ACCMODE); }
bool Creates(const char* mode) { return std::strpbrk(mode, "wa+") != nullptr; }
bool Writable(int fd) {
  const long flags = RawSyscall()(SYS_fcntl, fd, F_GETFL);
  return flags >= 0 && (flags & O_ACCMODE) != O_RDONLY;
}

}  // namespace

extern "C" {

// glibc's own allocators: no bootstrap is needed to reach them.
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);

// ---- opening
// -----------------------------------------------------------------------------------------------------------------
#define OPEN(name)                                                                                            \
  int Shim_##name(const char* path, int flags, ...) NAMED(name);                                              \
  int Shim_##name(const char* path, int flags, ...) {                                                         \
    va_list more;                                                                                             \
    va_start(more, flags);                                                                                    \
    const unsigned mode = (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(more, unsigned) : 0; \
    va_end(more);                                                                                             \
    static const auto real = REAL(name);                                                                      \
    const Call call(Creates(flags) ? kCreate : kOpen, #name, AT_FDCWD, path);                                 \
    return call.Fails() ? -1 : real(path, flags, mode);                                                       \
  }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                                          \
  int Shim_##name(int folder, const char* path, int flags, ...) NAMED(name);                                  \
  int Shim_##name(int folder, const char* path, int flags, ...) {                                             \
    va_list more;                                                                                             \
    va_start(more, flags);                                                                                    \
    const unsigned mode = (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(more, unsigned) : 0; \
    va_end(more);                                                                                             \
    static const auto real = REAL(name);                                                                      \
    const Call call(Creates(flags) ? kCreate : kOpen, #name, folder, path);                                   \
    return call.Fails() ? -1 : real(folder, path, flags, mode);                                               \
  }
OPENAT(openat)
OPENAT(openat64)

#define CREAT(name)                                           \
  int Shim_##name(const char* path, mode_t mode) NAMED(name); \
  int Shim_##name(const char* path, mode_t mode) {            \
    static const auto real = REAL(name);                      \
    const Call call(kCreate, #name, AT_FDCWD, path);          \
    return call.Fails() ? -1 : real(path, mode);              \
  }
CREAT(creat)
CREAT(creat64)

#define OPEN_CHECKED(name)                                                    \
  int Shim_##name(const char* path, int flags) NAMED(name);                   \
  int Shim_##name(const char* path, int flags) {                              \
    static const auto real = REAL(name);                                      \
    const Call call(Creates(flags) ? kCreate : kOpen, #name, AT_FDCWD, path); \
    return call.Fails() ? -1 : real(path, flags);                             \
  }
OPEN_CHECKED(__open_2)
OPEN_CHECKED(__open64_2)

#define FOPEN(name)                                                          \
  FILE* Shim_##name(const char* path, const char* mode) NAMED(name);         \
  FILE* Shim_##name(const char* path, const char* mode) {                    \
    static const auto real = REAL(name);                                     \
    const Call call(Creates(mode) ? kCreate : kOpen, #name, AT_FDCWD, path); \
    return call.Fails() ? nullptr : real(path, mode);                        \
  }
FOPEN(fopen)
FOPEN(fopen64)

DIR* Shim_opendir(const char* path) NAMED(opendir);
DIR* Shim_opendir(const char* path) {
  static const auto real = REAL(opendir);
  const Call call(kOpen, "opendir", AT_FDCWD, path);
  return call.Fails() ? nullptr : real(path);
}

#define MKSTEMP(name)                                \
  int Shim_##name(char* path) NAMED(name);           \
  int Shim_##name(char* path) {                      \
    static const auto real = REAL(name);             \
    const Call call(kCreate, #name, AT_FDCWD, path); \
    return call.Fails() ? -1 : real(path);           \
  }
MKSTEMP(mkstemp)
MKSTEMP(mkstemp64)

char* Shim_mkdtemp(char* path) NAMED(mkdtemp);
char* Shim_mkdtemp(char* path) {
  static const auto real = REAL(mkdtemp);
  const Call call(kMkdir, "mkdtemp", AT_FDCWD, path);
  return call.Fails() ? nullptr : real(path);
}

// ---- reading
// -----------------------------------------------------------------------------------------------------------------
ssize_t Shim_read(int fd, void* data, size_t size) NAMED(read);
ssize_t Shim_read(int fd, void* data, size_t size) {
  static const auto real = REAL(read);
  const Call call(kRead, "read", fd);
  return call.Fails() ? -1 : real(fd, data, size);
}

#define PREAD(name)                                                                 \
  ssize_t Shim_##name(int fd, void* data, size_t size, off64_t offset) NAMED(name); \
  ssize_t Shim_##name(int fd, void* data, size_t size, off64_t offset) {            \
    static const auto real = REAL(name);                                            \
    const Call call(kRead, #name, fd);                                              \
    return call.Fails() ? -1 : real(fd, data, size, offset);                        \
  }
PREAD(pread)
PREAD(pread64)

size_t Shim_fread(void* data, size_t size, size_t count, FILE* file) NAMED(fread);
size_t Shim_fread(void* data, size_t size, size_t count, FILE* file) {
  static const auto real = REAL(fread);
  const Call call(kRead, "fread", fileno(file));
  return call.Fails() ? 0 : real(data, size, count, file);
}

// ---- writing
// -----------------------------------------------------------------------------------------------------------------
ssize_t Shim_write(int fd, const void* data, size_t size) NAMED(write);
ssize_t Shim_write(int fd, const void* data, size_t size) {
  static const auto real = REAL(write);
  const Call call(kWrite, "write", fd);
  return call.Fails() ? -1 : real(fd, data, call.torn() ? size / 2 : size);
}

#define PWRITE(name)                                                                      \
  ssize_t Shim_##name(int fd, const void* data, size_t size, off64_t offset) NAMED(name); \
  ssize_t Shim_##name(int fd, const void* data, size_t size, off64_t offset) {            \
    static const auto real = REAL(name);                                                  \
    const Call call(kWrite, #name, fd);                                                   \
    return call.Fails() ? -1 : real(fd, data, call.torn() ? size / 2 : size, offset);     \
  }
PWRITE(pwrite)
PWRITE(pwrite64)

ssize_t Shim_writev(int fd, const iovec* parts, int count) NAMED(writev);
ssize_t Shim_writev(int fd, const iovec* parts, int count) {
  static const auto real = REAL(writev);
  const Call call(kWrite, "writev", fd);
  return call.Fails() ? -1 : real(fd, parts, count);
}

size_t Shim_fwrite(const void* data, size_t size, size_t count, FILE* file) NAMED(fwrite);
size_t Shim_fwrite(const void* data, size_t size, size_t count, FILE* file) {
  static const auto real = REAL(fwrite);
  const Call call(kWrite, "fwrite", fileno(file));
  return call.Fails() ? 0 : real(data, size, count, file);
}

int Shim_fflush(FILE* file) NAMED(fflush);
int Shim_fflush(FILE* file) {
  static const auto real = REAL(fflush);
  const int fd = file ? fileno(file) : -1;
  const Call call(kWrite, "fflush", fd);
  return call.Fails() ? -1 : real(file);
}

// Closing a stream writes what it still holds; the failure of that is reported after the stream is gone.
int Shim_fclose(FILE* file) NAMED(fclose);
int Shim_fclose(FILE* file) {
  static const auto real = REAL(fclose);
  const bool writable = Writable(fileno(file));
  if (!writable) return real(file);
  const Call call(kWrite, "fclose", fileno(file));
  const int result = real(file);
  return call.Fails() ? -1 : result;
}

#define TRUNCATE(name)                               \
  int Shim_##name(int fd, off64_t size) NAMED(name); \
  int Shim_##name(int fd, off64_t size) {            \
    static const auto real = REAL(name);             \
    const Call call(kWrite, #name, fd);              \
    return call.Fails() ? -1 : real(fd, size);       \
  }
TRUNCATE(ftruncate)
TRUNCATE(ftruncate64)

ssize_t Shim_copy_file_range(int in, off64_t* in_at, int out, off64_t* out_at, size_t size, unsigned flags)
    NAMED(copy_file_range);
ssize_t Shim_copy_file_range(int in, off64_t* in_at, int out, off64_t* out_at, size_t size, unsigned flags) {
  static const auto real = REAL(copy_file_range);
  const Call call(kWrite, "copy_file_range", out);
  return call.Fails() ? -1 : real(in, in_at, out, out_at, size, flags);
}

#define SENDFILE(name)                                                            \
  ssize_t Shim_##name(int out, int in, off64_t* offset, size_t size) NAMED(name); \
  ssize_t Shim_##name(int out, int in, off64_t* offset, size_t size) {            \
    static const auto real = REAL(name);                                          \
    const Call call(kWrite, #name, out);                                          \
    return call.Fails() ? -1 : real(out, in, offset, size);                       \
  }
SENDFILE(sendfile)
SENDFILE(sendfile64)

// ---- flushing, closing
// -------------------------------------------------------------------------------------------------------
#define FSYNC(name)                      \
  int Shim_##name(int fd) NAMED(name);   \
  int Shim_##name(int fd) {              \
    static const auto real = REAL(name); \
    const Call call(kFsync, #name, fd);  \
    return call.Fails() ? -1 : real(fd); \
  }
FSYNC(fsync)
FSYNC(fdatasync)
FSYNC(syncfs)

int Shim_close(int fd) NAMED(close);
int Shim_close(int fd) {
  static const auto real = REAL(close);
  if (!settings.active || !Writable(fd)) return real(fd);
  const Call call(kClose, "close", fd);
  const int result = real(fd);
  return call.Fails() ? -1 : result;
}

// ---- names
// -------------------------------------------------------------------------------------------------------------------
#define TWO_PATHS(name, kind)                                    \
  int Shim_##name(const char* from, const char* to) NAMED(name); \
  int Shim_##name(const char* from, const char* to) {            \
    static const auto real = REAL(name);                         \
    const Call call(kind, #name, AT_FDCWD, from, AT_FDCWD, to);  \
    return call.Fails() ? -1 : real(from, to);                   \
  }
TWO_PATHS(rename, kRename)
TWO_PATHS(link, kLink)
TWO_PATHS(symlink, kLink)

int Shim_renameat(int from_folder, const char* from, int to_folder, const char* to) NAMED(renameat);
int Shim_renameat(int from_folder, const char* from, int to_folder, const char* to) {
  static const auto real = REAL(renameat);
  const Call call(kRename, "renameat", from_folder, from, to_folder, to);
  return call.Fails() ? -1 : real(from_folder, from, to_folder, to);
}

int Shim_renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) NAMED(renameat2);
int Shim_renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  static const auto real = REAL(renameat2);
  const Call call(kRename, "renameat2", from_folder, from, to_folder, to);
  return call.Fails() ? -1 : real(from_folder, from, to_folder, to, flags);
}

int Shim_linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) NAMED(linkat);
int Shim_linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) {
  static const auto real = REAL(linkat);
  const Call call(kLink, "linkat", from_folder, from, to_folder, to);
  return call.Fails() ? -1 : real(from_folder, from, to_folder, to, flags);
}

int Shim_symlinkat(const char* text, int folder, const char* to) NAMED(symlinkat);
int Shim_symlinkat(const char* text, int folder, const char* to) {
  static const auto real = REAL(symlinkat);
  const Call call(kLink, "symlinkat", folder, to);
  return call.Fails() ? -1 : real(text, folder, to);
}

int Shim_mkdir(const char* path, mode_t mode) NAMED(mkdir);
int Shim_mkdir(const char* path, mode_t mode) {
  static const auto real = REAL(mkdir);
  const Call call(kMkdir, "mkdir", AT_FDCWD, path);
  return call.Fails() ? -1 : real(path, mode);
}

int Shim_mkdirat(int folder, const char* path, mode_t mode) NAMED(mkdirat);
int Shim_mkdirat(int folder, const char* path, mode_t mode) {
  static const auto real = REAL(mkdirat);
  const Call call(kMkdir, "mkdirat", folder, path);
  return call.Fails() ? -1 : real(folder, path, mode);
}

#define ONE_PATH(name)                               \
  int Shim_##name(const char* path) NAMED(name);     \
  int Shim_##name(const char* path) {                \
    static const auto real = REAL(name);             \
    const Call call(kUnlink, #name, AT_FDCWD, path); \
    return call.Fails() ? -1 : real(path);           \
  }
ONE_PATH(unlink)
ONE_PATH(rmdir)
ONE_PATH(remove)

int Shim_unlinkat(int folder, const char* path, int flags) NAMED(unlinkat);
int Shim_unlinkat(int folder, const char* path, int flags) {
  static const auto real = REAL(unlinkat);
  const Call call(kUnlink, "unlinkat", folder, path);
  return call.Fails() ? -1 : real(folder, path, flags);
}

// renameat2 has no function of its own in older C libraries and is then called by its number.
long Shim_syscall(long number, ...) NAMED(syscall);
long Shim_syscall(long number, ...) {
  va_list more;
  va_start(more, number);
  long a[6];
  for (long& value : a) value = va_arg(more, long);
  va_end(more);
  if (number == SYS_renameat2) {
    const Call call(kRename, "renameat2", static_cast<int>(a[0]), reinterpret_cast<const char*>(a[1]), static_cast<int>(a[2]),
                    reinterpret_cast<const char*>(a[3]));
    return call.Fails() ? -1 : RawSyscall()(number, a[0], a[1], a[2], a[3], a[4]);
  }
  return RawSyscall()(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

// ---- memory
// ------------------------------------------------------------------------------------------------------------------
void* Shim_malloc(size_t size) NAMED(malloc);
void* Shim_malloc(size_t size) {
  if (!settings.active || size < settings.least_bytes) return __libc_malloc(size);
  const Call call("malloc", size);
  return call.Fails() ? nullptr : __libc_malloc(size);
}

void* Shim_calloc(size_t count, size_t size) NAMED(calloc);
void* Shim_calloc(size_t count, size_t size) {
  if (!settings.active || count * size < settings.least_bytes) return __libc_calloc(count, size);
  const Call call("calloc", count * size);
  return call.Fails() ? nullptr : __libc_calloc(count, size);
}

void* Shim_realloc(void* old, size_t size) NAMED(realloc);
void* Shim_realloc(void* old, size_t size) {
  if (!settings.active || size < settings.least_bytes) return __libc_realloc(old, size);
  const Call call("realloc", size);
  return call.Fails() ? nullptr : __libc_realloc(old, size);
}

#define ALIGNED(name)                                                 \
  void* Shim_##name(size_t alignment, size_t size) NAMED(name);       \
  void* Shim_##name(size_t alignment, size_t size) {                  \
    const Call call(#name, size);                                     \
    return call.Fails() ? nullptr : __libc_memalign(alignment, size); \
  }
ALIGNED(aligned_alloc)
ALIGNED(memalign)

int Shim_posix_memalign(void** out, size_t alignment, size_t size) NAMED(posix_memalign);
int Shim_posix_memalign(void** out, size_t alignment, size_t size) {
  const Call call("posix_memalign", size);
  void* const memory = call.Fails() ? nullptr : __libc_memalign(alignment, size);
  if (!memory) return ENOMEM;
  *out = memory;
  return 0;
}

}  // extern "C"
