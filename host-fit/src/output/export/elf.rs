//! A blob as an ELF file: one segment to be loaded, one section of the same bytes.

use object::Endianness;
use object::elf;
use object::write::elf::{FileHeader, ProgramHeader, SectionHeader, Writer};

/// The ELF file. Flash tools read the segment, debuggers the section.
pub fn image(blob: &[u8], address: u32) -> Result<Vec<u8>, object::write::Error> {
    let size = blob.len() as u64;
    let address = u64::from(address);
    let mut bytes = Vec::new();
    let mut file = Writer::new(Endianness::Little, false, &mut bytes);
    file.reserve_file_header();
    file.reserve_program_headers(1);
    let offset = file.reserve(blob.len(), 4) as u64;
    file.reserve_null_section_index();
    let name = file.add_section_name(b".parameters");
    file.reserve_section_index();
    file.reserve_shstrtab_section_index();
    file.reserve_shstrtab();
    file.reserve_section_headers();

    file.write_file_header(&FileHeader {
        os_abi: elf::ELFOSABI_NONE,
        abi_version: 0,
        e_type: elf::ET_EXEC,
        e_machine: elf::EM_ARM,
        e_entry: 0,
        e_flags: elf::EF_ARM_EABI_VER5,
    })?;
    file.write_align_program_headers();
    file.write_program_header(&ProgramHeader {
        p_type: elf::PT_LOAD,
        p_flags: elf::PF_R,
        p_offset: offset,
        p_vaddr: address,
        p_paddr: address,
        p_filesz: size,
        p_memsz: size,
        p_align: 4,
    });
    file.write_align(4);
    file.write(blob);
    file.write_shstrtab();
    file.write_null_section_header();
    file.write_section_header(&SectionHeader {
        name: Some(name),
        sh_type: elf::SHT_PROGBITS,
        sh_flags: u64::from(elf::SHF_ALLOC),
        sh_addr: address,
        sh_offset: offset,
        sh_size: size,
        sh_link: 0,
        sh_info: 0,
        sh_addralign: 4,
        sh_entsize: 0,
    });
    file.write_shstrtab_section_header();
    Ok(bytes)
}
