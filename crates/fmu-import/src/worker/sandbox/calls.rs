//! The system calls that the sandbox restricts, and the filter for them.

use libc::{c_long, sock_filter};

#[derive(Debug, Clone, Copy)]
pub(super) enum Condition {
    Always,
    /// One of these bits of an argument is set.
    Bits(usize, u32),
    /// An argument has this value after applying a mask (argument, mask, value).
    Is(usize, u32, u32),
    /// An argument is neither 0 nor the worker's process ID.
    OtherProcess(usize),
    /// A pointer is not null.
    Pointer(usize),
}
use Condition::{Always, Bits, Is, OtherProcess, Pointer};

/// Arguments that specify a file: the descriptor of the folder in which a relative path starts, and the path.
pub(super) type Place = (Option<usize>, usize);

/// The effect of a call, and its arguments.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    /// Starts a program.
    Program(Place),
    /// Communicates with other programs or machines. The argument is the address family.
    Network(Option<usize>),
    /// Opens a file, possibly for writing. With `Some`, this argument contains the flags. With `None`, the structure
    /// after the path contains them.
    Open(Place, Option<usize>),
    /// Creates, changes, deletes or renames files.
    Change(&'static [Place]),
    /// Changes the mode, owner, times or attributes of a file, which Landlock does not restrict.
    Attributes(Place),
    /// Like `Attributes`, for an open file.
    AttributesOfOpen(usize),
    /// Sends a signal (second argument) to a process or a group.
    Signal(usize, usize),
    /// Sends a signal to a process specified by a descriptor.
    SignalByDescriptor(usize),
    /// Changes the scheduling of a process. With `None`, the first argument is the process. Otherwise it is the second
    /// argument, and the first one must have this value.
    Schedule(Option<i32>),
    /// Has no legitimate use in an FMU.
    Other,
}
use Kind::{Attributes, AttributesOfOpen, Change, Network, Open, Other, Program, Schedule, Signal, SignalByDescriptor};

#[derive(Debug, Clone, Copy)]
pub(super) struct Call {
    pub(super) number: c_long,
    pub(super) name: &'static str,
    condition: Condition,
    pub(super) kind: Kind,
}

/// Flags of open(2) for writing.
pub(super) const WRITES: i32 = libc::O_WRONLY | libc::O_RDWR | libc::O_CREAT | libc::O_TRUNC;

/// `AUDIT_ARCH_*` of this processor. Other system-call interfaces, with other numbers, are denied.
const ARCHITECTURE: Option<u32> = if cfg!(target_arch = "x86_64") {
    Some(0xc000_003e)
} else if cfg!(target_arch = "aarch64") {
    Some(0xc000_00b7)
} else {
    None
};

/// Bit in the call numbers of x32, another system-call interface of the same processor.
const X32: u32 = 0x4000_0000;

macro_rules! calls {
    ($($($name:ident)|+ if $condition:expr => $kind:expr,)*) => {
        [$($(Call {
            number: libc::$name,
            name: stringify!($name).trim_start_matches("SYS_"),
            condition: $condition,
            kind: $kind,
        }),+),*]
    };
}

/// The calls of other processors are not listed here, so there is no filter for them.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(super) fn restricted() -> Option<Vec<Call>> {
    None
}

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
pub(super) fn restricted() -> Option<Vec<Call>> {
    // Calls that are too new to have a name in the C library.
    let newer = [(452, "fchmodat2"), (463, "setxattrat"), (466, "removexattrat"), (468, "file_setattr")];
    let newer = newer.map(|(number, name)| Call { number, name, condition: Always, kind: Attributes((Some(0), 1)) });
    let mut list = newer.to_vec();
    list.extend(calls! {
        SYS_execve if Always => Program((None, 0)),
        SYS_execveat if Always => Program((Some(0), 1)),
        SYS_socket if Always => Network(Some(0)),
        // A pair of sockets is connected within the process, but datagram sockets can send to other addresses.
        SYS_socketpair if Is(1, 0xf, SOCK_DGRAM) => Network(Some(0)),
        SYS_connect | SYS_bind | SYS_listen | SYS_accept | SYS_accept4 if Always => Network(None),
        SYS_sendto if Pointer(4) => Network(None),
        SYS_openat if Bits(2, WRITES as u32) => Open((Some(0), 1), Some(2)),
        SYS_openat2 if Always => Open((Some(0), 1), None),
        SYS_truncate if Always => Change(&[(None, 0)]),
        SYS_mkdirat | SYS_mknodat | SYS_unlinkat if Always => Change(&[(Some(0), 1)]),
        SYS_renameat | SYS_renameat2 | SYS_linkat if Always => Change(&[(Some(0), 1), (Some(2), 3)]),
        SYS_symlinkat if Always => Change(&[(Some(1), 2)]),
        SYS_fchmod | SYS_fchown | SYS_fsetxattr | SYS_fremovexattr if Always => AttributesOfOpen(0),
        SYS_fchmodat | SYS_fchownat | SYS_utimensat if Always => Attributes((Some(0), 1)),
        SYS_setxattr | SYS_lsetxattr | SYS_removexattr | SYS_lremovexattr if Always => Attributes((None, 0)),
        SYS_kill | SYS_rt_sigqueueinfo if OtherProcess(0) => Signal(0, 1),
        SYS_kill if Is(0, u32::MAX, 0) => Signal(0, 1),
        SYS_tkill if Always => Signal(0, 1),
        SYS_tgkill | SYS_rt_tgsigqueueinfo if OtherProcess(0) => Signal(0, 2),
        SYS_pidfd_send_signal if Always => SignalByDescriptor(0),
        SYS_sched_setaffinity | SYS_sched_setattr | SYS_sched_setparam | SYS_sched_setscheduler if OtherProcess(0)
            => Schedule(None),
        SYS_setpriority if OtherProcess(1) => Schedule(Some(PRIO_PROCESS)),
        SYS_setpriority if Is(0, u32::MAX, PRIO_USER) => Schedule(Some(PRIO_PROCESS)),
        SYS_ioprio_set if OtherProcess(1) => Schedule(Some(IOPRIO_WHO_PROCESS)),
        SYS_ioprio_set if Is(0, u32::MAX, IOPRIO_WHO_USER) => Schedule(Some(IOPRIO_WHO_PROCESS)),
        SYS_prlimit64 if OtherProcess(0) => Other,
        // Both can inject input into the terminal.
        SYS_ioctl if Is(1, u32::MAX, TIOCSTI) => Other,
        SYS_ioctl if Is(1, u32::MAX, TIOCLINUX) => Other,
        // Access to other processes.
        SYS_ptrace | SYS_process_vm_readv | SYS_process_vm_writev | SYS_process_madvise | SYS_pidfd_getfd
            if Always => Other,
        // Namespaces and file systems.
        SYS_setns | SYS_unshare | SYS_mount | SYS_umount2 | SYS_mount_setattr | SYS_move_mount | SYS_open_tree
            | SYS_fsopen | SYS_fspick | SYS_fsconfig | SYS_fsmount | SYS_pivot_root | SYS_chroot
            | SYS_open_by_handle_at | SYS_quotactl if Always => Other,
        // The machine, its kernel and its keys; `io_uring`, whose requests bypass the filter.
        SYS_acct | SYS_swapon | SYS_swapoff | SYS_reboot | SYS_kexec_load | SYS_init_module | SYS_finit_module
            | SYS_delete_module | SYS_bpf | SYS_perf_event_open | SYS_userfaultfd | SYS_io_uring_setup
            | SYS_sethostname | SYS_setdomainname | SYS_settimeofday | SYS_clock_settime | SYS_clock_adjtime
            | SYS_adjtimex | SYS_syslog | SYS_vhangup | SYS_add_key | SYS_request_key | SYS_keyctl if Always => Other,
        // Shared memory, messages and semaphores of other programs: these have no paths, and their IDs can be guessed.
        SYS_shmget | SYS_shmat | SYS_shmctl | SYS_msgget | SYS_msgsnd | SYS_msgrcv | SYS_msgctl | SYS_semget
            | SYS_semop | SYS_semtimedop | SYS_semctl | SYS_mq_open | SYS_mq_unlink | SYS_mq_notify
            | SYS_mq_timedreceive if Always => Other,
    });
    // Old calls, which newer processors do not have.
    #[cfg(target_arch = "x86_64")]
    list.extend(calls! {
        SYS_open if Bits(1, WRITES as u32) => Open((None, 0), Some(1)),
        SYS_creat | SYS_mkdir | SYS_mknod | SYS_rmdir | SYS_unlink if Always => Change(&[(None, 0)]),
        SYS_rename | SYS_link if Always => Change(&[(None, 0), (None, 1)]),
        SYS_symlink if Always => Change(&[(None, 1)]),
        SYS_chmod | SYS_chown | SYS_lchown | SYS_utime | SYS_utimes if Always => Attributes((None, 0)),
        SYS_futimesat if Always => Attributes((Some(0), 1)),
        SYS_iopl | SYS_ioperm | SYS_kexec_file_load if Always => Other,
    });
    Some(list)
}

// Constants converted to the type of arguments.
const SOCK_DGRAM: u32 = libc::SOCK_DGRAM as u32;
const TIOCSTI: u32 = libc::TIOCSTI as u32;
const TIOCLINUX: u32 = libc::TIOCLINUX as u32;
/// From `linux/resource.h` and `linux/ioprio.h`. Defined here because their types differ between C libraries.
const PRIO_PROCESS: i32 = 0;
const PRIO_USER: u32 = 2;
const IOPRIO_WHO_PROCESS: i32 = 1;
const IOPRIO_WHO_USER: u32 = 3;

/// Offsets in `struct seccomp_data`: call number, `AUDIT_ARCH_*`, and lower and upper half of an argument.
const NUMBER: u32 = 0;
const INTERFACE: u32 = 4;
const fn lower(argument: usize) -> u32 {
    16 + 8 * argument as u32
}
const fn upper(argument: usize) -> u32 {
    lower(argument) + 4
}

fn load(offset: u32) -> sock_filter {
    statement(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS, offset)
}

fn finish(action: u32) -> sock_filter {
    statement(libc::BPF_RET | libc::BPF_K, action)
}

fn statement(code: u32, k: u32) -> sock_filter {
    sock_filter { code: code as u16, jt: 0, jf: 0, k }
}

/// Skips `jt` instructions if the comparison is true, otherwise `jf` instructions.
fn jump(comparison: u32, k: u32, jt: u8, jf: u8) -> sock_filter {
    sock_filter { code: (libc::BPF_JMP | comparison | libc::BPF_K) as u16, jt, jf, k }
}

const DENY: u32 = libc::SECCOMP_RET_ERRNO | libc::EPERM as u32;

/// The filter. With `listens`, restricted calls wait for the guard. Otherwise they fail, or Landlock restricts them.
pub(super) fn filter(calls: &[Call], worker: u32, listens: bool) -> Vec<sock_filter> {
    let allow = libc::SECCOMP_RET_ALLOW;
    let mut filter =
        vec![load(INTERFACE), jump(libc::BPF_JEQ, ARCHITECTURE.unwrap_or(0), 1, 0), finish(DENY), load(NUMBER)];
    if cfg!(target_arch = "x86_64") {
        filter.extend([jump(libc::BPF_JGE, X32, 0, 1), finish(DENY)]);
    }
    for call in calls {
        let action = match call.kind {
            _ if listens => libc::SECCOMP_RET_USER_NOTIF,
            Open(..) | Change(_) => continue,
            _ => DENY,
        };
        // The instructions for a call return an action, or fall through to the instructions for the next call.
        let rest = match call.condition {
            Always => vec![finish(action)],
            Bits(argument, bits) => {
                vec![load(lower(argument)), jump(libc::BPF_JSET, bits, 0, 1), finish(action), load(NUMBER)]
            }
            Is(argument, mask, value) => vec![
                load(lower(argument)),
                statement(libc::BPF_ALU | libc::BPF_AND | libc::BPF_K, mask),
                jump(libc::BPF_JEQ, value, 0, 1),
                finish(action),
                load(NUMBER),
            ],
            OtherProcess(argument) => vec![
                load(lower(argument)),
                jump(libc::BPF_JEQ, 0, 2, 0),
                jump(libc::BPF_JEQ, worker, 1, 0),
                finish(action),
                load(NUMBER),
            ],
            Pointer(argument) => vec![
                load(lower(argument)),
                jump(libc::BPF_JEQ, 0, 0, 2),
                load(upper(argument)),
                jump(libc::BPF_JEQ, 0, 1, 0),
                finish(action),
                load(NUMBER),
            ],
        };
        let over = u8::try_from(rest.len()).unwrap_or(u8::MAX);
        filter.push(jump(libc::BPF_JEQ, call.number as u32, 0, over));
        filter.extend(rest);
    }
    filter.push(finish(allow));
    filter
}
